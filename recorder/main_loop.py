"""The recorder process's loop: rings in, log and publication out, commands and reports over the control channel.

Commands: `{"command": "start", "path", "recording", "session", "pulses", "seconds", "rig_toml"}`, `{"command":
"stop"}`, `{"command": "camera_gone", "camera", "reason"}`, `{"command": "quit"}`. Reports carry `report`: `ready`,
`camera`, `warm`, `started`, `progress`, `health`, `finished`, `failed`.
"""

import os
import select
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from recorder.assembler import Assembler, CameraChange, CameraState, Triplet, least_buffers
from recorder.events import Event, Level
from recorder.publisher import Publisher
from recorder.recording import Recording, RecordingOrder
from recorder.triplet_buffers import TripletBuffers
from rig.clocks import NS_PER_S, HostNs, host_now
from rig.control import ControlChannel, Message
from rig.errors import BadInputError, StorageError, SvevError
from rig.frame import FrameStatus
from rig.ring import CameraRing
from rig.settings import RigSettings
from triggering.pairing import ClosedPulse

_LEVELS: Final = {
    CameraState.CONNECTED: Level.INFO,
    CameraState.SILENT: Level.WARNING,
    CameraState.GONE: Level.ERROR,
}
_REPORT_EVERY_NS: Final = NS_PER_S // 5
_WARM_PULSES: Final = 3


class RecorderLoop:
    """Owns the triplet buffers, the assembler, the publisher and the recording in progress.

    Args:
        rig: the rig.
        rings: one per camera.
        doorbell: eventfd that the grabbers ring.
        control: channel to the service process.
    """

    def __init__(self, rig: RigSettings, rings: Sequence[CameraRing], doorbell: int, control: ControlChannel) -> None:
        self._rig, self._rings, self._doorbell, self._control = rig, rings, doorbell, control
        count = max(least_buffers(rig.trigger.period_ns), round(rig.recorder.triplets_s * rig.trigger.rate_hz))
        self._buffers = TripletBuffers(rig.triplet_shape, count)
        self._assembler = Assembler(rig, rings, self._buffers)
        self._publisher = Publisher(rig.network.publish, rig.network.publish_ipc, queue=count // 4)
        self._recording: Recording | None = None
        self._quit = False
        self._warm = 0
        self._frames_before: list[int] = [0] * len(rings)
        now = host_now()
        self._next_report, self._next_health = now, HostNs(now + NS_PER_S)

    def run(self, terminated: Callable[[], bool]) -> None:
        """Work until told to quit, or the service process is gone; then finish what is being recorded."""
        self._report("ready")
        poll = select.poll()
        poll.register(self._doorbell, select.POLLIN)
        poll.register(self._control, select.POLLIN)
        while not self._quit and not terminated():
            ready = {fd for fd, _ in poll.poll(self._sleep_ms(host_now()))}
            if self._doorbell in ready:
                os.eventfd_read(self._doorbell)
            if self._control.fileno() in ready:
                for message in self._control.receive(0):
                    self._obey(message)
                self._quit = self._quit or self._control.ended
            self._step(host_now())
        self._wind_up()

    def _step(self, now: HostNs) -> None:
        for triplet in self._assembler.pump(now):
            self._dispose(triplet)
        for change in self._assembler.changes():
            self._camera_changed(change)
        if self._recording is not None and self._recording.finished(now):
            self._finish()
        if now >= self._next_report:
            self._next_report = HostNs(now + _REPORT_EVERY_NS)
            if self._recording is not None:
                self._control.send({"report": "progress", **self._recording.ledger.counts()}, or_drop=True)
        if now >= self._next_health:
            self._next_health = HostNs(now + NS_PER_S)
            self._tell_health()

    def _dispose(self, triplet: Triplet) -> None:
        """A decided pulse goes into the recording, or nowhere."""
        pulse, slot = triplet.pulse, triplet.slot
        recording = self._recording
        if recording is None or not recording.takes(pulse):
            self._warm_up(pulse)
            if slot is not None:
                self._buffers.release(slot)
            return
        if slot is None and (slot := self._buffers.acquire()) is not None:
            self._buffers.pixels(slot).fill(0)  # no frame came at all: a black triplet
        tag = recording.tag(pulse)
        encoded = tag.encode()
        self._publisher.triplet(encoded, self._buffers, slot)
        with self._storage_guarded():
            recording.write(tag, slot, encoded)

    def _warm_up(self, pulse: ClosedPulse) -> None:
        """Count whole triplets before the first recording: only then is the rig known to work together."""
        complete = all(outcome.status is FrameStatus.OK for outcome in pulse.outcomes)
        self._warm = self._warm + 1 if complete else 0
        if self._warm == _WARM_PULSES:
            self._report("warm")

    def _obey(self, message: Message) -> None:
        match message.get("command"):
            case "start":
                self._start(message)
            case "stop" if self._recording is not None:
                self._recording.stop()
            case "camera_gone":
                self._assembler.disconnected(message["camera"], message["reason"], host_now())
            case "quit":
                self._quit = True

    def _start(self, message: Message) -> None:
        order = RecordingOrder(
            Path(message["path"]), message["recording"], message["session"], message["pulses"], message["seconds"],
            message["rig_toml"].encode(),
        )  # fmt: skip
        try:
            if self._recording is not None:
                raise BadInputError("a recording is running: stop it before starting another")
            self._recording = Recording(order, self._rig, self._assembler, self._buffers)
        except SvevError as error:
            self._report("failed", kind=type(error).__name__, message=str(error))
        else:
            self._report("started", path=str(order.path))

    def _finish(self) -> None:
        recording, self._recording = self._recording, None
        if recording is None:
            return
        try:
            summary = recording.close()
        except StorageError as error:
            recording.log.abandon()
            self._report("failed", kind=type(error).__name__, message=str(error))
            return
        counts = recording.ledger.counts()
        dropped = self._publisher.dropped
        self._report("finished", path=str(recording.path), bytes=summary.bytes, unpublished=dropped, **counts)

    @contextmanager
    def _storage_guarded(self) -> Iterator[None]:
        """What is written within may fail: then the recording ends, keeps what it holds, and everybody is told."""
        try:
            yield
        except StorageError as error:
            recording, self._recording = self._recording, None
            if recording is not None:
                recording.log.abandon()
            self._publisher.event(Event.now(Level.FATAL, "recorder", str(error)).to_json())
            self._report("failed", kind=type(error).__name__, message=str(error))

    def _camera_changed(self, change: CameraChange) -> None:
        self._report("camera", camera=change.camera, state=change.state.value, text=change.text)
        name = self._rig.cameras[change.camera].name
        self._happened(Event.now(_LEVELS[change.state], name, f"{change.state}: {change.text}"))

    def _happened(self, event: Event) -> None:
        """Publish an event, and write it into the recording if there is one."""
        self._publisher.event(event.to_json())
        if self._recording is not None:
            with self._storage_guarded():
                self._recording.event(event)

    def _tell_health(self) -> None:
        health = self._health()
        self._publisher.health(health)
        self._control.send({"report": "health", **health}, or_drop=True)
        if self._recording is None:
            return
        with self._storage_guarded():
            self._recording.health(health)
        self._keep_reserve()

    def _keep_reserve(self) -> None:
        """End the recording, whole, while there is still room to close it."""
        recording, reserve = self._recording, self._rig.recorder.reserve_gb
        if recording is None or (free := recording.log.free_bytes()) >= reserve * 1e9:
            return
        why = f"only {free / 1e9:.1f} GB are free and {reserve:g} GB are kept in reserve: recording stopped; make room"
        self._happened(Event.now(Level.ERROR, "recorder", why))
        with self._storage_guarded():
            recording.close()
            raise StorageError(f"{recording.path}: {why}; the log is whole up to there")

    def _health(self) -> dict[str, Any]:
        """Rates, queues, drops, clocks, temperature, disk: what the last second looked like."""
        cameras = []
        for index, (settings, ring) in enumerate(zip(self._rig.cameras, self._rings, strict=True)):
            counters = ring.counters()
            rate = counters["frames"] - self._frames_before[index]
            self._frames_before[index] = counters["frames"]
            cameras.append(
                {"name": settings.name, "connected": self._assembler.connected[index], "frames_per_s": rate, **counters}
            )
        return {
            "cameras": cameras,
            "pairing": self._assembler.pairer.health(),
            "free_triplets": self._buffers.free_count,
            "unpublished": self._publisher.dropped,
            "recording": None if self._recording is None else self._recording.log.statistics(),
        }

    def _wind_up(self) -> None:
        if self._recording is not None:
            why = "the service process is gone" if self._control.ended else "told to quit"
            self._happened(Event.now(Level.ERROR, "recorder", f"recording ends early: {why}"))
            self._finish()
        self._publisher.close()
        self._buffers.close()

    def _sleep_ms(self, now: HostNs) -> float:
        deadlines = [self._next_report, self._next_health]
        if (undecided := self._assembler.pairer.next_deadline()) is not None:
            deadlines.append(undecided)
        if self._assembler.backlog:
            deadlines.append(HostNs(now + NS_PER_S // 1000))
        return max(0.0, (min(deadlines) - now) / 1e6)

    def _report(self, report: str, **content: Any) -> None:
        self._control.send({"report": report, **content})
