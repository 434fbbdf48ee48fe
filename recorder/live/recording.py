"""One recording: which pulses belong to it, their numbers and tags, and its log."""

from pathlib import Path
from typing import Final

from recorder.live.assembler import Assembler
from recorder.writing.log_writer import LogDescription, LogSummary, LogWriter
from rig.clocks import NS_PER_S, HostNs, UtcAnchor, UtcNs, host_now
from rig.events import Event, Level
from rig.pulse import PulseNumber
from rig.tag import TripletTag
from rig.transport.messages import StartRecording
from triggering.ledger import Ledger
from triggering.pairing.pairer import ClosedPulse

#: A pulse generator may be slower than the rig file says by this share: the recording still gets all its pulses.
_SLOW: Final = 0.01


class Recording:
    """Writes pulses into one log, numbered from 1.

    Args:
        order: what to record.
        assembler: makes the triplets.

    Attributes:
        commanded: when the command to start came.
        begin: time of the first pulse that may belong to the recording; may be before `commanded`.
        ledger: counts of what has been recorded so far.
        log: writes the log.
    """

    def __init__(self, order: StartRecording, assembler: Assembler) -> None:
        rig = assembler.rig
        self._order, self._shape, self._assembler = order, rig.triplet_shape, assembler
        self._anchor = UtcAnchor.take()
        self.commanded = host_now()
        back = order.preroll_s
        self.begin = HostNs(0 if back is None else self.commanded - round(back * NS_PER_S))
        self._end: HostNs | None = None
        self._ended = False
        self._since_command = 0
        if order.seconds is not None:
            # If the pulses are counted, the clock only ends a recording whose pulses come too slowly or stop coming.
            grace = 0 if order.pulses is None else round(order.seconds * NS_PER_S * _SLOW) + 2 * rig.trigger.period_ns
            self._end = HostNs(self.commanded + round(order.seconds * NS_PER_S) + grace)
        self.ledger = Ledger()
        cameras = ", ".join(camera.name for camera in rig.cameras)
        self.log = LogWriter(
            order.path,
            LogDescription(
                session={"recording": order.recording, **order.session},
                rig={"name": rig.name, "cameras": cameras, "rate_hz": str(rig.trigger.rate_hz)},
                rig_toml=order.rig_toml.encode(),
                calibration_json=None if order.calibration is None else order.calibration.json,
                calibrations={} if order.calibration is None else order.calibration.cameras,
            ),
            assembler.buffers,
        )

    @property
    def path(self) -> Path:
        """Path of the log."""
        return self._order.path

    def finished(self, now: HostNs) -> bool:
        """Whether no further pulse belongs to the recording, provided that all pulses decided by `now` were offered."""
        return self._ended or self._counted or (self._end is not None and now > self._end + self._assembler.hold_ns)

    def stop(self) -> None:
        """End with the last pulse that has fired until now."""
        self._end = host_now()

    def is_over(self, pulse: ClosedPulse) -> bool:
        """Whether a pulse comes after the recording's last one. Pulses come in order: the first such pulse ends it."""
        self._ended = self._ended or self._counted or (self._end is not None and pulse.time > self._end)
        return self._ended

    @property
    def _counted(self) -> bool:
        """Whether the recording has as many pulses as ordered."""
        return self._order.pulses is not None and self._since_command >= self._order.pulses

    def tag(self, pulse: ClosedPulse) -> TripletTag:
        """The tag of the next pulse of the recording, with its number in it."""
        cameras = self._assembler.camera_tags(pulse, self._anchor)
        session = self._order.session.get("session", "")
        number, time = PulseNumber(self.ledger.pulses + 1), self._anchor.utc(pulse.time)
        return TripletTag(number, time, session, self._order.recording, self._shape, cameras)

    def write(self, tag: TripletTag, slot: int | None, encoded: bytes, ready: HostNs) -> None:
        """Write one pulse; the log holds the triplet buffer until the pixels are on disk.

        Args:
            tag: the pulse's tag.
            slot: the triplet buffer, None if there is none: only the tag is written.
            encoded: the tag in JSON.
            ready: when the triplet was ready.
        """
        self.ledger.add(tag)
        self._since_command += self._anchor.host(tag.time) >= self.commanded
        log_time = self._anchor.utc(ready)
        self.log.write_pulse(tag, slot, log_time, encoded)

    def event(self, event: Event) -> None:
        """Write one event."""
        self.log.write_event(event)

    def health(self, health: bytes, time: HostNs) -> None:
        """Write the encoded health record of the second that ended at `time`."""
        self.log.write_health(health, self._anchor.utc(time))

    def utc(self, time: HostNs) -> UtcNs:
        """UTC of a host time, on the same time scale as the recording's tags."""
        return self._anchor.utc(time)

    def close(self) -> LogSummary:
        """Finish the log.

        Raises:
            StorageError: not everything could be written; what is in the log is readable.
        """
        self.event(Event.now(Level.INFO, "recorder", f"recording stopped: {self.ledger.summary_line()}"))
        return self.log.close()
