"""One recording: from the pulse after the start to the last pulse, into one log."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from recorder.assembler import Assembler
from recorder.events import Event, Level
from recorder.ledger import Ledger
from recorder.log_writer import LogSummary, LogWriter
from recorder.triplet_buffers import TripletBuffers
from rig.clocks import NS_PER_S, HostNs, UtcAnchor, host_now
from rig.settings import RigSettings
from rig.tag import TripletTag
from triggering.pairing import ClosedPulse

#: A pulse generator may be so much slower than the rig file says, and a recording still gets all its pulses.
_SLOW: Final = 0.01


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


class Recording:
    """Writes the pulses from now on into one log, numbered from 1.

    Attributes:
        ledger: what has been recorded so far.
        log: the log.
    """

    def __init__(self, order: RecordingOrder, rig: RigSettings, assembler: Assembler, buffers: TripletBuffers) -> None:
        self._order, self._shape, self._assembler = order, rig.triplet_shape, assembler
        self._anchor = UtcAnchor.take()
        self._begin = host_now()
        self._end: HostNs | None = None
        self._over = False
        if order.seconds is not None:
            # Pulses are counted; the clock only ends a recording whose pulses come too slowly, or no more.
            grace = round(order.seconds * NS_PER_S * _SLOW) + 2 * rig.trigger.period_ns
            self._end = HostNs(self._begin + round(order.seconds * NS_PER_S) + grace)
        self.ledger = Ledger()
        cameras = ", ".join(camera.name for camera in rig.cameras)
        self.log = LogWriter(
            order.path,
            rig.triplet_shape,
            session={"recording": order.recording, **order.session},
            rig={"name": rig.name, "cameras": cameras, "rate_hz": str(rig.trigger.rate_hz)},
            rig_toml=order.rig_toml,
            buffers=buffers,
        )
        self.event(Event.now(Level.INFO, "recorder", f"recording {order.recording} started"))

    @property
    def path(self) -> Path:
        """The log."""
        return self._order.path

    def finished(self, now: HostNs) -> bool:
        """All pulses that were ordered are in, or the time is over and every pulse until then is decided."""
        if self._over or (self._order.pulses is not None and self.ledger.pulses >= self._order.pulses):
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
            self.ledger.pulses + 1, self._anchor.utc(pulse.time), session, self._order.recording, self._shape, cameras
        )  # fmt: skip

    def write(self, tag: TripletTag, slot: int | None, encoded: bytes) -> None:
        """Write one pulse; the log holds the buffer until it is on disk."""
        self.ledger.add(tag)
        ready = self._anchor.utc(host_now())
        if slot is None:
            self.log.write_tag_only(tag, pulse_time=tag.time, log_time=ready, encoded=encoded)
        else:
            self.log.write_triplet(slot, tag, pulse_time=tag.time, log_time=ready, encoded=encoded)

    def event(self, event: Event) -> None:
        """Write one event."""
        self.log.write_event(event.level, event.name, event.message, event.time)

    def health(self, health: Mapping[str, Any]) -> None:
        """Write the health of the last second."""
        self.log.write_health(health, self._anchor.utc(host_now()))

    def close(self) -> LogSummary:
        """Finish the log.

        Raises:
            StorageError: not everything is in it; what is in it is readable.
        """
        self.event(Event.now(Level.INFO, "recorder", f"recording stopped: {self.ledger.summary_line()}"))
        return self.log.close()
