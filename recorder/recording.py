"""One recording: from the first pulse, which may have fired before the command, to the last, into one log."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from recorder.assembler import Assembler
from recorder.events import Event, Level
from recorder.ledger import Ledger
from recorder.log_writer import LogSummary, LogWriter
from recorder.triplet_buffers import TripletBuffers
from rig.clocks import NS_PER_S, HostNs, UtcAnchor, UtcNs, host_now
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
        pulses: stop after so many, counted from the command; None: until told.
        seconds: stop so long after the command even if fewer pulses came; None: until told.
        rig_toml: the rig file as it was read, attached to the log.
        preroll_s: begin so long before the command, as far as pulses are held; None: with the oldest that is held.
    """

    path: Path
    recording: str
    session: Mapping[str, str]
    pulses: int | None
    seconds: float | None
    rig_toml: bytes
    preroll_s: float | None = 0.0


class Recording:
    """Writes pulses into one log, numbered from 1.

    Attributes:
        commanded: when it was started.
        begin: pulses from then on belong to it.
        ledger: what has been recorded so far.
        log: the log.
    """

    def __init__(self, order: RecordingOrder, rig: RigSettings, assembler: Assembler, buffers: TripletBuffers) -> None:
        self._order, self._shape, self._assembler = order, rig.triplet_shape, assembler
        self._anchor = UtcAnchor.take()
        self.commanded = host_now()
        back = order.preroll_s
        self.begin = HostNs(0 if back is None else self.commanded - round(back * NS_PER_S))
        self._end: HostNs | None = None
        self._ended = False
        self._since_command = 0
        if order.seconds is not None:
            # Where pulses are counted, the clock only ends a recording whose pulses come too slowly, or no more.
            grace = 0 if order.pulses is None else round(order.seconds * NS_PER_S * _SLOW) + 2 * rig.trigger.period_ns
            self._end = HostNs(self.commanded + round(order.seconds * NS_PER_S) + grace)
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

    @property
    def path(self) -> Path:
        """The log."""
        return self._order.path

    def finished(self, now: HostNs) -> bool:
        """Whether no pulse will come any more, all that are decided at `now` having been offered."""
        return self._ended or self._counted or (self._end is not None and now > self._end + self._assembler.hold_ns)

    def stop(self) -> None:
        """Take no pulse that fires later than now."""
        self._end = host_now()

    def is_over(self, pulse: ClosedPulse) -> bool:
        """Whether a pulse comes after the recording's last. Pulses come in order, so the first such one ends it."""
        self._ended = self._ended or self._counted or (self._end is not None and pulse.time > self._end)
        return self._ended

    @property
    def _counted(self) -> bool:
        """All pulses that were ordered are in."""
        return self._order.pulses is not None and self._since_command >= self._order.pulses

    def tag(self, pulse: ClosedPulse) -> TripletTag:
        """Number the pulse in this recording."""
        cameras = self._assembler.camera_tags(pulse, self._anchor)
        session = self._order.session.get("session", "")
        return TripletTag(
            self.ledger.pulses + 1, self._anchor.utc(pulse.time), session, self._order.recording, self._shape, cameras
        )  # fmt: skip

    def write(self, tag: TripletTag, slot: int | None, encoded: bytes, ready: HostNs) -> None:
        """Write one pulse that was ready then; the log holds the buffer until it is on disk."""
        self.ledger.add(tag)
        self._since_command += self._anchor.host(tag.time) >= self.commanded
        log_time = self._anchor.utc(ready)
        if slot is None:
            self.log.write_tag_only(tag, pulse_time=tag.time, log_time=log_time, encoded=encoded)
        else:
            self.log.write_triplet(slot, tag, pulse_time=tag.time, log_time=log_time, encoded=encoded)

    def event(self, event: Event) -> None:
        """Write one event."""
        self.log.write_event(event.level, event.name, event.message, event.time)

    def health(self, health: Mapping[str, Any], time: HostNs) -> None:
        """Write the health of the second that ended then."""
        self.log.write_health(health, self._anchor.utc(time))

    def utc(self, time: HostNs) -> UtcNs:
        """UTC of a host time, as the recording's tags have it."""
        return self._anchor.utc(time)

    def close(self) -> LogSummary:
        """Finish the log.

        Raises:
            StorageError: not everything is in it; what is in it is readable.
        """
        self.event(Event.now(Level.INFO, "recorder", f"recording stopped: {self.ledger.summary_line()}"))
        return self.log.close()
