"""One recording: from the pulse after the start to the last pulse, into one log."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from recorder.assembler import Assembler
from recorder.log_writer import LogSummary, LogWriter
from recorder.triplet_buffers import TripletBuffers
from rig.clocks import NS_PER_S, HostNs, UtcAnchor, host_now
from rig.frame import FrameStatus
from rig.settings import RigSettings
from rig.tag import TripletTag
from triggering.pairing import ClosedPulse


@dataclass(frozen=True, slots=True)
class RecordingOrder:
    """What to record.

    Attributes:
        path: file to create.
        recording: id of the recording.
        session: fields of the session (athlete, bib, gate, wind, notes, operator, session).
        pulses: stop after so many; None: until told.
        seconds: stop then even if fewer pulses came; None: until told.
        rig_toml: the rig file as it was read, attached to the log.
    """

    path: Path
    recording: str
    session: Mapping[str, str]
    pulses: int | None
    seconds: float | None
    rig_toml: bytes


@dataclass(slots=True)
class Tally:
    """What has been recorded so far."""

    pulses: int = 0
    complete: int = 0
    causes: Counter[FrameStatus] = field(default_factory=Counter)

    def to_json(self) -> dict[str, Any]:
        """Counts as the command line reports them; causes count frames, not pulses."""
        failures = [status for status in FrameStatus if status is not FrameStatus.OK]
        return {
            "pulses": self.pulses,
            "complete": self.complete,
            "partial": self.pulses - self.complete,
            "causes": {status.value: self.causes[status] for status in failures},
        }


class Recording:
    """Writes the pulses from `begin` on into one log, numbered from 1."""

    def __init__(self, order: RecordingOrder, rig: RigSettings, assembler: Assembler, buffers: TripletBuffers) -> None:
        self._order, self._shape, self._assembler = order, rig.triplet_shape, assembler
        self._anchor = UtcAnchor.take()
        self._begin = host_now()
        self._end: HostNs | None = None
        self._over = False
        if order.seconds is not None:
            # Pulses are counted; the clock only ends a recording whose pulses have stopped coming.
            self._end = HostNs(self._begin + round(order.seconds * NS_PER_S) + rig.trigger.period_ns)
        self.tally = Tally()
        cameras = ", ".join(camera.name for camera in rig.cameras)
        self.log = LogWriter(
            order.path,
            rig.triplet_shape,
            session={"recording": order.recording, **order.session},
            rig={"name": rig.name, "cameras": cameras, "rate_hz": str(rig.trigger.rate_hz)},
            rig_toml=order.rig_toml,
            buffers=buffers,
        )
        self.event("info", f"recording {order.recording} started")

    @property
    def path(self) -> Path:
        """The log."""
        return self._order.path

    def finished(self, now: HostNs) -> bool:
        """All pulses that were ordered are in, or the time is over and every pulse until then is decided."""
        if self._over or (self._order.pulses is not None and self.tally.pulses >= self._order.pulses):
            return True
        return self._end is not None and now > self._end + self._assembler.hold_ns

    def stop(self) -> None:
        """Take no pulse that fires later than now."""
        self._end = host_now()

    def takes(self, pulse: ClosedPulse) -> bool:
        """Whether a pulse belongs to this recording. Pulses come in order, so the first later one ends it."""
        self._over = self._over or (self._end is not None and pulse.time > self._end)
        return pulse.time >= self._begin and not self.finished(self._begin)

    def tag(self, pulse: ClosedPulse) -> TripletTag:
        """Number the pulse in this recording."""
        cameras = self._assembler.camera_tags(pulse, self._anchor)
        session = self._order.session.get("session", "")
        return TripletTag(
            self.tally.pulses + 1, self._anchor.utc(pulse.time), session, self._order.recording, self._shape, cameras
        )  # fmt: skip

    def write(self, tag: TripletTag, slot: int | None, encoded: bytes) -> None:
        """Write one pulse; the log holds the buffer until it is on disk."""
        self.tally.pulses += 1
        self.tally.complete += tag.complete
        self.tally.causes.update(camera.status for camera in tag.cameras if camera.status is not FrameStatus.OK)
        ready = self._anchor.utc(host_now())
        if slot is None:
            self.log.write_tag_only(tag, pulse_time=tag.time, log_time=ready, encoded=encoded)
        else:
            self.log.write_triplet(slot, tag, pulse_time=tag.time, log_time=ready, encoded=encoded)

    def event(self, level: str, message: str, source: str = "recorder") -> None:
        """Write one event."""
        self.log.write_event(level, source, message, self._anchor.utc(host_now()))

    def health(self, health: Mapping[str, Any]) -> None:
        """Write the health of the last second."""
        self.log.write_health(health, self._anchor.utc(host_now()))

    def close(self) -> LogSummary:
        """Finish the log."""
        tally = self.tally
        self.event("info", f"recording stopped: {tally.pulses} pulses, {tally.complete} complete")
        return self.log.close()
