"""The recorder process's loop: rings in, log and publication out, commands and reports over the control channel.

Commands: `{"command": "start", "path", "recording", "session", "pulses", "seconds", "preroll_s", "rig_toml"}`,
`{"command": "stop"}`, `{"command": "camera_gone", "camera", "reason"}`, `{"command": "event", ...}` with the JSON
of an event, `{"command": "quit"}`. Reports carry `report`: `ready`, `camera`, `warm`, `started`, `progress`, `health`,
`finished`, `failed`.
"""

import os
import select
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from recorder.assembler import Assembler, CameraChange, CameraState, Triplet, least_buffers
from recorder.events import Event, Level
from recorder.health import Health
from recorder.mcap_layout import SlotLayout
from recorder.preroll import Preroll, preroll_triplets
from recorder.publisher import Publisher
from recorder.recording import RecordingOrder
from recorder.recordings import Recordings
from recorder.triplet_buffers import TripletBuffers
from rig.clocks import NS_PER_S, HostNs, host_now
from rig.control import ControlChannel, Message
from rig.errors import SvevError
from rig.preview import PreviewSlot
from rig.ring import CameraRing
from rig.settings import RigSettings

_LEVELS: Final = {
    CameraState.CONNECTED: Level.INFO,
    CameraState.SILENT: Level.WARNING,
    CameraState.GONE: Level.ERROR,
    CameraState.NOTICE: Level.WARNING,
}
_REPORT_EVERY_NS: Final = NS_PER_S // 5
_PRESSING_NS: Final = NS_PER_S // 1000
_WARM_PULSES: Final = 3


@dataclass(frozen=True, slots=True)
class RecorderOptions:
    """What the service decides.

    Attributes:
        directory: where recordings go; its disk is watched.
        preroll_s: hold so much of the past while no recording runs.
        preview: where images for people go.
    """

    directory: Path
    preroll_s: float = 0.0
    preview: PreviewSlot | None = None


class RecorderLoop:
    """Owns the triplet buffers, the assembler, the publisher and the recordings.

    Args:
        rig: the rig.
        rings: one per camera.
        doorbell: eventfd that the grabbers ring.
        control: channel to the service process.
        options: what the service decides.
    """

    def __init__(
        self,
        rig: RigSettings,
        rings: Sequence[CameraRing],
        doorbell: int,
        control: ControlChannel,
        options: RecorderOptions,
    ) -> None:
        self._rig, self._doorbell, self._control, self._preview = rig, doorbell, control, options.preview
        in_flight = max(least_buffers(rig.trigger.period_ns), round(rig.recorder.triplets_s * rig.trigger.rate_hz))
        held = preroll_triplets(rig, options.preroll_s, SlotLayout(rig.triplet_shape).slot_bytes)
        self._buffers = TripletBuffers(rig.triplet_shape, in_flight + held)
        self._assembler = Assembler(rig, rings, self._buffers)
        self._publisher = Publisher(rig.network.publish, rig.network.publish_ipc, queue=in_flight // 4)
        self._preroll = Preroll(self._buffers, options.preroll_s, held)
        self._health = Health(rig, rings, options.directory)
        self._recordings = Recordings(
            rig, self._assembler, self._buffers, self._publisher, self._preroll, self._health.latency, self._report
        )
        self._quit = False
        self._warm = 0
        now = host_now()
        self._next_report, self._next_health = now, HostNs(now + NS_PER_S)

    def run(self, terminated: Callable[[], bool]) -> None:
        """Work until told to quit, or the service process is gone; then finish what is being recorded."""
        if self._preview is not None:
            self._preview.take_over()
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
        self._recordings.wind_up("the service process is gone" if self._control.ended else "told to quit")
        self._publisher.close()
        self._buffers.close()

    def _step(self, now: HostNs) -> None:
        for triplet in self._assembler.pump(now):
            self._take_in(triplet, now)
        for change in self._assembler.changes():
            self._camera_changed(change)
        self._recordings.work(now)
        if now >= self._next_report:
            self._next_report = HostNs(now + _REPORT_EVERY_NS)
            self._recordings.progress()
        if now >= self._next_health:
            self._next_health = HostNs(now + NS_PER_S)
            self._tell_health(now)

    def _take_in(self, triplet: Triplet, now: HostNs) -> None:
        """Look at a decided pulse and pass it on."""
        self._health.pulse(triplet.pulse)
        if self._preview is not None and self._preview.due(now):
            pixels = None if triplet.slot is None else self._buffers.pixels(triplet.slot)
            statuses = [outcome.status for outcome in triplet.pulse.outcomes]
            self._preview.write(triplet.pulse.number, triplet.pulse.time, statuses, pixels, now)
        if not self._recordings.running:  # only when whole triplets come the rig is known to work together
            self._warm = self._warm + 1 if triplet.pulse.complete else 0
            if self._warm == _WARM_PULSES:
                self._report("warm")
        self._recordings.take(triplet)

    def _obey(self, message: Message) -> None:
        match message.get("command"):
            case "start":
                self._start(message)
            case "stop":
                self._recordings.stop()
            case "camera_gone":
                self._assembler.disconnected(message["camera"], message["reason"], host_now())
            case "event":
                self._recordings.happened(Event.from_json(message))
            case "quit":
                self._quit = True

    def _start(self, message: Message) -> None:
        order = RecordingOrder(
            Path(message["path"]), message["recording"], message["session"], message["pulses"], message["seconds"],
            message["rig_toml"].encode(), message.get("preroll_s", 0.0),
        )  # fmt: skip
        try:
            self._recordings.start(order)
        except SvevError as error:
            self._report("failed", kind=type(error).__name__, message=str(error))

    def _camera_changed(self, change: CameraChange) -> None:
        self._report("camera", camera=change.camera, state=change.state.value, text=change.text)
        name = self._rig.cameras[change.camera].name
        self._recordings.happened(Event.now(_LEVELS[change.state], name, f"{change.state}: {change.text}"))

    def _tell_health(self, now: HostNs) -> None:
        """Rates, queues, drops, clocks, temperature, disk: what the last second looked like."""
        health = self._health.record(
            self._assembler.connected,
            {
                "pairing": self._assembler.pairer.health(),
                "free_triplets": self._buffers.free_count,
                "unpublished": self._publisher.dropped,
                "preroll": self._preroll.health(now),
                "recording": self._recordings.statistics(),
            },
        )
        self._publisher.health(health)
        self._control.send({"report": "health", **health}, or_drop=True)
        self._recordings.health(health)

    def _sleep_ms(self, now: HostNs) -> float:
        deadlines = [self._next_report, self._next_health]
        if (undecided := self._assembler.pairer.next_deadline()) is not None:
            deadlines.append(undecided)
        if self._assembler.backlog or self._recordings.pressing:
            deadlines.append(HostNs(now + _PRESSING_NS))
        return max(0.0, (min(deadlines) - now) / 1e6)

    def _report(self, report: str, **content: Any) -> None:
        self._control.send({"report": report, **content})
