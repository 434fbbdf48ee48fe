"""Runs a rig without panel, for `svev record`, `svev demo` and benchmarks: a program commands the service's supervisor.

```
with HeadlessRig(rig, rig_toml, on_event) as running:
    running.wait_until_warm()
    running.start_recording(path, session, pulses, seconds)
    result = running.wait_until_finished(on_progress, stop)
```

Unlike the service it does not start again what failed, except a grabber: the program is told at once why there is no
result.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future
from concurrent.futures import TimeoutError as FutureTimeoutError
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Final, Self, TypeVar

from rig.api.recordings import Counts, SessionFields
from rig.api.status import State
from rig.errors import (
    BadInputError,
    CameraError,
    CameraNotFoundError,
    ProcessDiedError,
    StorageError,
    UnknownRecordingError,
)
from rig.events import PAIRING, Event, Level
from rig.host.endings import Asks, heed, nobody_asks
from rig.settings.model import RigSettings
from rig.transport import wire
from rig.transport.recorder_commands import RecorderOptions, StartRecording
from rig.transport.recorder_reports import RecordingFinished
from service.processes.backends import check_backends
from service.processes.memory import check_memory
from service.processes.rig_session import StartHill
from service.processes.seen import CameraPresence
from service.recordings.in_progress import Outcome
from service.recordings.storage import check_room_for
from service.status.event_hub import EventHub
from service.supervision.messages import Arm, Begin, Close, Command
from service.supervision.situation import Situation
from service.supervision.supervisor import Supervisor
from triggering.sources.choice import trigger_source

T = TypeVar("T")
#: Shows progress: called with label and number of steps, gives a function to call with the number of steps done.
Progress = Callable[[str, int | None], AbstractContextManager[Callable[[int], None]]]

_ANSWER_S: Final = 20.0
_STOP_S: Final = 30.0
_POLL_S: Final = 0.1


class HeadlessRig:
    """All processes of one rig, simulated cameras included; a context manager that stops them whatever happens.

    Args:
        rig: the rig.
        rig_toml: the rig file's text, attached to every log.
        on_event: called with one line for each camera that comes or goes and each process that is started again.
        hill: starts the simulated cameras; None: as the rig file says.

    Raises:
        BadInputError: a camera's back end cannot be driven here, or the rig's calibration file is missing or wrong.
    """

    def __init__(
        self, rig: RigSettings, rig_toml: str, on_event: Callable[[str], None], hill: StartHill | None = None
    ) -> None:
        def tell(event: Event) -> None:
            if event.name == PAIRING and event.level is not Level.INFO:
                self._alarms[event.code or event.message] = event.message
            if event.code == "event_camera_connected":
                self._absent.pop(event.name, None)
            if event.code == "event_camera_absent":
                self._absent[event.name] = event.message  # told once: by the error, or when it goes on without them
            elif event.name != "service":
                on_event(f"{event.name} {event.message}")

        check_backends(rig)
        check_memory(rig, preroll_s=0.0)
        self._rig = rig
        options = RecorderOptions(directory=rig.recorder.directory)
        self._supervisor = Supervisor(rig, rig_toml, EventHub(tell), options, hill=hill, enduring=False)
        self._path: Path | None = None
        self._alarms: dict[str, str] = {}
        self._absent: dict[str, str] = {}
        self._on_event = on_event
        self._ended: Future[Outcome] = Future()

    def __enter__(self) -> Self:
        self._supervisor.start()
        try:
            self._ask(Arm)
        except BaseException:
            self.__exit__(None, None, None)
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._supervisor.stop(_STOP_S)

    @property
    def pids(self) -> dict[str, int]:
        """Process ids by row of the process table."""
        return {row.name: row.pid for row in self._supervisor.status.processes if row.pid is not None}

    @property
    def alarms(self) -> list[str]:
        """What has been wrong with clocks, trigger or rate, in words, since the cameras were first connected."""
        return list(self._alarms.values())

    def wait_until_warm(self, asks: Asks = nobody_asks) -> None:
        """Wait until all cameras together have delivered a few complete triplets.

        A camera that failed to answer gets `trigger.settle_s`, and so do the pulses once all cameras are connected.
        Then it goes on without those that are missing, if `trigger.min_cameras` allows it.

        Args:
            asks: tells how often a person has asked to end.

        Raises:
            KeyboardInterrupt: a person has.
            CameraNotFoundError: too few cameras answer in time.
            CameraError: all cameras are connected, but no complete triplet came.
            BadInputError: pulses come at another rate than the rig file names.
            SvevError: the rig cannot be set up.
        """
        began = complete_since = time.monotonic()
        settle_s = self._rig.trigger.settle_s
        while True:
            heed(asks)
            now = self._look()
            state, seen = now.state, now.seen
            if seen.warm and state is State.ARMED:
                self._tell_absent()
                return
            fault, moment = now.fault.statement, time.monotonic()
            if seen.cameras is None:
                began = moment  # the simulated hill and the processes are still being started
            elif state is State.FAULT and fault is not None and fault.code == "fault_wrong_rate":
                raise BadInputError(f"{fault.text}: {fault.advice}")
            elif all(camera.present for camera in seen.cameras):
                if moment > complete_since + settle_s:
                    raise CameraError(
                        f"all cameras are ready, but no complete triplet came within {settle_s:g} s: "
                        f"{trigger_source(self._rig.trigger).advice}"
                    )
                time.sleep(_POLL_S)
                continue
            # A camera that failed to answer gets `settle_s`; one whose process is still starting gets longer.
            elif moment > began + (settle_s if all(camera.tried for camera in seen.cameras) else _ANSWER_S):
                if sum(camera.present for camera in seen.cameras) < self._rig.least_cameras:
                    self._raise_absent(seen.cameras)
                if state is State.ARMED:
                    self._tell_absent()
                    return
            complete_since = moment
            time.sleep(_POLL_S)

    def _tell_absent(self) -> None:
        """Say which cameras it goes on without."""
        for camera, message in self._absent.items():
            self._on_event(f"{camera} {message}")

    def start_recording(
        self,
        path: Path,
        *,
        session: Mapping[str, str],
        pulses: int | None = None,
        seconds: float | None = None,
    ) -> None:
        """Start a recording; it ends after `pulses`, after `seconds`, or with `stop_recording`.

        Raises:
            SvevError: the log cannot be created.
        """
        order = StartRecording(path=path, session=session, pulses=pulses, seconds=seconds)
        self._path, self._ended = path, Future()
        begin = partial(Begin, start=order, session=SessionFields(), ended=self._ended)
        begun = self._ask(begin)  # under another name, if another program has taken this one meanwhile
        self._path = path.with_name(f"{begun.id}{path.suffix}")

    def stop_recording(self, *, wait_for_disk: bool = True) -> None:
        """End the recording with the pulses that have fired until now; one that has just ended stays as it is.

        Args:
            wait_for_disk: False: give up what the disk has not taken.
        """
        with suppress(UnknownRecordingError):
            self._ask(partial(Close, at_once=not wait_for_disk))

    def wait_until_finished(self, on_progress: Callable[[Counts], None], stop: Asks) -> RecordingFinished:
        """Wait for the end of the recording.

        Args:
            on_progress: called with the counts so far.
            stop: called several times a second; tells how often a person has asked to end the recording. Who asks twice
                does not want to wait for the disk.

        Raises:
            StorageError: the log could not be made.
            ProcessDiedError: the recorder died; what was written is readable.
        """
        asked = 0
        while True:
            if (asks := stop()) > asked:
                asked = asks
                self.stop_recording(wait_for_disk=asks == 1)
            try:
                outcome = self._ended.result(_POLL_S)
            except FutureTimeoutError:
                if (recording := self._supervisor.status.recording) is not None:
                    on_progress(recording.counts)
                continue
            if isinstance(outcome, RecordingFinished):
                self._await_truth(stop)
                return outcome
            if isinstance(outcome, ProcessDiedError):
                kept = f"the log until then is readable: svev verify {self._path}"
                raise ProcessDiedError(f"{outcome}; {kept}; then start again")
            raise outcome

    def _await_truth(self, stop: Callable[[], int]) -> None:
        """Wait until the truth of simulated cameras is written, unless a person asks to end."""
        asked = stop()
        while self._supervisor.truths.busy and stop() == asked:
            self._supervisor.truths.wait(_POLL_S)

    def _ask(self, make: "Callable[[Future[T]], Command[T]]") -> T:
        """Give the supervisor a command; if it has ended, raise the error that ended it."""
        try:
            return self._supervisor.ask(make, _ANSWER_S)
        except ProcessDiedError as error:
            raise self._supervisor.now.loop.failure or error from None

    def _look(self) -> Situation:
        """The situation; if an error has ended the supervisor, raise it."""
        now = self._supervisor.now
        if now.loop.failure is not None:
            raise now.loop.failure
        return now

    def _raise_absent(self, cameras: Sequence[CameraPresence]) -> None:
        told: dict[str, list[str]] = {}  # by the remedy, which may be the same for all
        for camera, heard in zip(self._rig.cameras, cameras, strict=True):
            if not heard.present:
                said = heard.said.text or (
                    f"camera {camera.name} at {camera.address} does not answer: check power, cable and address"
                )
                what, _, remedy = said.partition(": ")
                told.setdefault(remedy, []).append(what)
        reasons = "; ".join(": ".join(filter(None, (", ".join(what), remedy))) for remedy, what in told.items())
        present = sum(heard.present for heard in cameras)
        without = f"; to record without, set min_cameras = {present} under [trigger] in the rig file" if present else ""
        raise CameraNotFoundError(reasons + without)


@dataclass(frozen=True, slots=True)
class Recorded:
    """What became of a recording.

    Attributes:
        report: of the recorder.
        alarms: messages of the alarms during it.
        stopped_early: a person ended it.
    """

    report: RecordingFinished
    alarms: tuple[str, ...]
    stopped_early: bool

    @property
    def logs(self) -> tuple[Path, ...]:
        """Its logs, in order."""
        return (*(part.path for part in self.report.earlier), self.report.path)

    @property
    def disk_error(self) -> StorageError | None:
        """Why images are missing because of the disk; None if the disk did its work."""
        report = self.report
        if report.failure is not None:
            error = report.failure.error()
            return error if isinstance(error, StorageError) else StorageError(str(error))
        return StorageError(f"{report.path}: {report.trouble}") if report.trouble else None

    def to_json(self) -> dict[str, object]:
        """As `svev record --json` prints it."""
        return {
            "log": str(self.report.path),
            **self.report.counts.model_dump(),
            "pauses": [wire.to_builtins(pause) for pause in self.report.pauses],
            "alarms": list(self.alarms),
            "bytes": self.report.bytes,
            "unpublished": self.report.unpublished,
            "stopped_early": self.stopped_early,
            "logs": [str(log) for log in self.logs],
        }


def record(
    running: HeadlessRig,
    rig: RigSettings,
    path: Path,
    seconds: float,
    *,
    session: Mapping[str, str],
    progress: Progress,
    asks: Asks,
) -> Recorded:
    """Record once: wait until the rig is warm, record, wait for the end.

    Args:
        running: the rig's processes.
        rig: the rig.
        path: the log to make.
        seconds: length of the recording.
        session: session fields for the log.
        progress: shows how many pulses are recorded.
        asks: tells how often a person has asked to end; the recording ends early then, and is closed properly.

    Raises:
        KeyboardInterrupt: a person asked to end before the recording began.
        SvevError: the disk has no room, a camera does not answer, the log cannot be made, the recorder died.
    """
    check_room_for(rig, path.parent, seconds)
    running.wait_until_warm(asks)
    pulses = max(1, round(seconds * rig.trigger.rate_hz))
    with progress(f"recording {path.name}", pulses) as advance:
        running.start_recording(path, session=session, pulses=pulses, seconds=seconds)
        report = running.wait_until_finished(lambda counts: advance(counts.pulses), asks)
        return Recorded(report, tuple(running.alarms), stopped_early=asks() > 0)
