"""Finds what people who are elsewhere should know, by comparing each status of the service with the one before."""

from collections.abc import Iterator
from datetime import UTC, datetime
from typing import Final, Literal

from rig.api.fields import Model
from rig.api.recordings import Recording
from rig.api.statement import Level
from rig.api.status import CameraState, State, Status
from rig.settings.webhook import Occasion

#: A change of a camera, of the fault or of the disk is told so long after the last one of it at the earliest, s: a
#: camera with a loose plug comes and goes every few seconds.
_TOLD_AGAIN_S: Final = 60.0
#: The disk is nearly full when no more jumps than these fit on it; the page warns at the same numbers.
_FEW_JUMPS: Final = (20, 1)


class Notification(Model):
    """A notification for the webhook, sent as JSON.

    Attributes:
        event: what it is about; "test" comes from `svev doctor --send-test`.
        over: the fault or the alarm is over, or the camera is back.
        time: when it happened, UTC.
        rig: name of the rig.
        state: state of the service then.
        level: severity.
        text: what happened, one line.
        advice: what to do about it, empty if nothing.
        recording: the recording that ended, with its verdict; null if it is about something else.
        number: counts up with every notification of this run of the service; the same if it is sent again.
        dropped: so many before this one were dropped, because too many waited or the receiver refused them.
    """

    event: Occasion | Literal["test"]
    over: bool = False
    time: datetime
    rig: str
    state: State
    level: Level
    text: str
    advice: str = ""
    recording: Recording | None = None
    number: int = 0
    dropped: int = 0


class Occasions:
    """Compares statuses. Only one thread may use it.

    Args:
        wanted: the occasions that are told.
    """

    def __init__(self, wanted: tuple[Occasion, ...]) -> None:
        self._wanted = wanted
        self._told: dict[str, tuple[bool, float]] = {}
        self._alarms_told: dict[str, tuple[str, str]] = {}  # topic and text of what is not over yet
        self._ended: str | None = None

    def look(self, status: Status, now: float) -> list[tuple[Notification, str]]:
        """Compare a status with the notifications until now.

        Args:
            status: present status.
            now: present time on the monotonic clock, s.

        Returns:
            What to tell, each with the id of the recording whose verdict belongs to it; empty: none.
        """
        found = [
            *self._fault(status, now), *self._cameras(status, now), *self._disk(status, now),
            *self._alarms(status, now),
        ]  # fmt: skip
        told = [(notification, "") for notification in found if notification.event in self._wanted]
        if status.last_recording not in {None, self._ended}:
            self._ended = status.last_recording
            if "recording" in self._wanted:
                text = f"recording {status.last_recording} ended"
                told.append((_notification(status, "recording", text), status.last_recording or ""))
        return told

    def _fault(self, status: Status, now: float) -> Iterator[Notification]:
        """The fault, or its end. Disarming needs no notification."""
        said = status.statement
        if status.state in {State.IDLE, State.DISARMING}:
            self._told.pop("fault", None)
        elif status.state is State.FAULT and self._changed("fault", True, now):
            yield _notification(status, "fault", said.text, said.advice)
        elif status.state in {State.ARMED, State.RECORDING} and self._changed("fault", False, now):
            yield _notification(status, "fault", f"the fault is over: {said.text}", over=True)

    def _cameras(self, status: Status, now: float) -> Iterator[Notification]:
        """Cameras that are gone or back. While a camera is being connected, its presence is not known."""
        for camera in status.cameras:
            topic, said = f"camera {camera.name}", camera.statement
            if camera.state is CameraState.OFF:
                self._told.pop(topic, None)
            elif camera.state is CameraState.ABSENT and self._changed(topic, True, now):
                yield _notification(status, "cameras", said.text, said.advice)
            elif camera.state in {CameraState.READY, CameraState.SILENT} and self._changed(topic, False, now):
                yield _notification(status, "cameras", f"{camera.name} is back", over=True)

    def _alarms(self, status: Status, now: float) -> Iterator[Notification]:
        """Alarms of pulses, clocks and cameras, and their ends. Disarming needs no notification."""
        if status.state in {State.IDLE, State.DISARMING}:
            for key in self._alarms_told:
                self._told.pop(key, None)
            self._alarms_told.clear()
        for alarm in status.alarms:
            said = alarm.statement
            key = f"alarm {alarm.topic} {said.level}"
            if self._changed(key, True, now):
                self._alarms_told[key] = alarm.topic, said.text
                yield _notification(status, "alarms", said.text, said.advice)
        topics = {alarm.topic for alarm in status.alarms}
        for key, (topic, text) in list(self._alarms_told.items()):
            if topic not in topics and self._changed(key, False, now):
                del self._alarms_told[key]
                yield _notification(status, "alarms", f"over: {text}", over=True)

    def _disk(self, status: Status, now: float) -> Iterator[Notification]:
        left = status.disk.jumps_left
        passed = [few for few in _FEW_JUMPS if self._changed(f"disk {few}", left <= few, now) and left <= few]
        if passed:
            text = f"room for {left} more jumps of {status.disk.jump_s:g} s on the disk"
            advice = "delete recordings and empty the trash, or move them to another disk"
            yield _notification(status, "disk", text, advice)

    def _changed(self, topic: str, bad: bool, now: float) -> bool:
        """Note a state; whether it differs from the last notification, and enough time has passed since."""
        told, at = self._told.get(topic, (False, -_TOLD_AGAIN_S))
        if bad is told or now < at + _TOLD_AGAIN_S:
            return False
        self._told[topic] = bad, now
        return True


def _notification(status: Status, event: Occasion, text: str, advice: str = "", *, over: bool = False) -> Notification:
    level = Level.GOOD if over else Level.ERROR if event in {"fault", "cameras"} else Level.WARNING
    return Notification(
        event=event, over=over, time=datetime.now(UTC), rig=status.rig, state=status.state, level=level, text=text,
        advice=advice,
    )  # fmt: skip


def with_verdict(notification: Notification, recording: Recording) -> Notification:
    """The notification that a recording ended, with its verdict."""
    said = recording.verdict
    session = recording.session
    who = " ".join(text for text in (session.bib, session.athlete) if text)
    text = f"{notification.text}{f' ({who})' if who else ''}: {said.text}"
    return notification.model_copy(
        update={"level": said.level, "text": text, "advice": said.advice, "recording": recording}
    )
