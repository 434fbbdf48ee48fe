"""One recording: which pulses belong to it, their numbers and tags, and its log. Nothing here waits for the disk."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

import msgspec

from recorder.live.assembler import Assembler
from recorder.live.in_flight import InFlight
from recorder.live.opening import OpeningLog
from recorder.live.preroll import Held
from recorder.live.span import Span
from recorder.live.tagging import Tagger
from recorder.log.extent import (
    CONTINUES,
    CONTINUES_AFTER,
    DISK_SAID,
    ENDED_EARLY,
    ENDED_EARLY_SAID,
    FORGOTTEN,
    NEXT_PART,
    PART,
    as_field,
    extent,
)
from recorder.log.tag_room import check_tag_fits
from recorder.writing.log_writer import LogDescription, LogWriter
from rig.clocks import NS_PER_S, HostNs, UtcAnchor, UtcNs, host_now
from rig.errors import FileVanishedError, StorageError
from rig.events import Event
from rig.health import WritingHealth
from rig.phrase import Phrase
from rig.pulse import PulseNumber
from rig.tag import TripletTag
from rig.topics import RECORDING_METADATA, SESSION_METADATA, TROUBLE_METADATA
from rig.transport.recorder_commands import GoesOn, StartRecording, TellResult
from rig.transport.recorder_reports import LogPart
from triggering.ledger.account import Ledger
from triggering.pairing.pairer import ClosedPulse

_NO_PULSE: Final = PulseNumber(0)


@dataclass(slots=True)
class Ending:
    """How a log ends.

    Attributes:
        failure: the error that ended it before its time, None if there was none.
        early: why it ends before the recording was to end; None: it does not.
        trouble: what went wrong with the disk without ending it; None: nothing.
        next_part: id of the log in which the recording goes on when this one is as large as a part may be; empty: none.
    """

    failure: StorageError | None = None
    early: Phrase | None = None
    trouble: Phrase | None = None
    next_part: str = ""

    def fields(self) -> dict[str, str]:
        """What the log says of it."""
        fields: dict[str, str] = {}
        if self.early is not None:
            fields |= {ENDED_EARLY: str(self.early), ENDED_EARLY_SAID: as_field(self.early)}
        if self.next_part:
            fields[NEXT_PART] = self.next_part
        if self.trouble is not None:
            fields[DISK_SAID] = as_field(self.trouble)
        return fields


@dataclass(slots=True)
class Account:
    """From when until when a log tells of every pulse; time without pulses in between is a pause.

    Attributes:
        anchor: the recording's relation of host time to UTC.
        period_ns: nominal time between two pulses.
        since: the command, or the last pulse in the log before.
        until: the end; None as long as it is not known.
        last_before: number of the last pulse in the log before, 0: there is none.
        ledger: what became of the pulses that are in the file.
    """

    anchor: UtcAnchor
    period_ns: int
    since: HostNs
    until: HostNs | None = None
    last_before: PulseNumber = _NO_PULSE
    ledger: Ledger = field(default_factory=Ledger)

    def goes_on(self, since: HostNs, last_before: PulseNumber) -> None:
        """Begin after the last pulse in the log before."""
        self.since, self.last_before = since, last_before
        self.ledger.follows(last_before)
        self._tell_ledger()

    def end(self, until: HostNs) -> None:
        """Fix the end."""
        self.until = until
        self._tell_ledger()

    def first_number(self, time: HostNs, dead: GoesOn | None) -> PulseNumber:
        """Number of the log's first pulse: those that fired while there was no recorder are counted by time."""
        periods = 1
        if dead is not None and dead.time is not None:
            periods = max(1, round((time - self.since) / dead.period_ns))
        return PulseNumber(self.last_before + periods)

    def _tell_ledger(self) -> None:
        until = None if self.until is None else self.anchor.utc(self.until)
        self.ledger.lasted(self.anchor.utc(self.since), until, self.period_ns)


class Recording:
    """Writes pulses into one log, numbered from 1, or from where the log before it ends.

    Args:
        order: what to record.
        assembler: makes the triplets.
        after: a recording whose log failed, or is as large as a part may be, and which this one continues.
        part: which part of a split recording the log is; from the second one on, `after` takes pulses until `follow`.

    Raises:
        BadInputError: the names of session and recording are too long for the log.

    Attributes:
        span: which pulses belong to the recording.
        account: from when until when the log tells of every pulse, and what became of those in the file.
        ending: how the log ends.
        in_flight: its pulses that are not known to be in the file, or are kept.
        opening: the log, on its way to being open.
        continues: id of the recording that this one continues, empty if none.
        mishap: whether it was stopped as soon as it had begun: its pulses belong to the next recording too.
    """

    def __init__(
        self, order: StartRecording, assembler: Assembler, after: "Recording | None" = None, part: int = 1
    ) -> None:
        rig, buffers, session_name = assembler.rig, assembler.buffers, order.session.get("session", "")
        check_tag_fits(buffers.layout, [camera.name for camera in rig.cameras], session_name, order.recording)
        self._order, self._assembler = order, assembler
        anchor = UtcAnchor.take() if after is None or part == 1 else after.account.anchor
        period_ns = rig.trigger.period_ns
        self._tagger = Tagger(rig, anchor, session_name, order.recording)
        self.in_flight = InFlight(buffers)
        self.ending = Ending()
        self.mishap = False
        self.continues = ""
        self.span: Span = Span.ordered(order, period_ns, host_now()) if after is None else after.span
        self.account: Account = Account(anchor, period_ns, self.span.commanded)
        if after is None:
            self._begin(order.goes_on)
        else:
            self.follow(after)
        cameras = ", ".join(camera.name for camera in rig.cameras)
        self._session = {"recording": order.recording, **order.session}
        if self.continues:
            self._session |= {CONTINUES: self.continues}
            # the log before a part takes pulses while this one is made
            self._session |= self._after if part == 1 else {PART: str(part)}
        description = LogDescription(
            session=self._session,
            rig={"name": rig.name, "cameras": cameras, "rate_hz": str(rig.trigger.rate_hz)},
            rig_toml=order.rig_toml.encode(),
            calibration_json=None if order.calibration is None else order.calibration.json,
            calibrations={} if order.calibration is None else order.calibration.cameras,
            begin=anchor.utc(host_now()),
        )
        self.opening = OpeningLog(order.path, description, buffers, host_now())

    def _begin(self, dead: GoesOn | None) -> None:
        """Begin with the command, or after the last pulse of a recorder that died."""
        since, last_before = self.span.commanded, _NO_PULSE
        if dead is not None:
            self.continues, last_before = dead.recording, dead.pulse
            if dead.time is not None:
                since = self.account.anchor.host(dead.time)
                self.span.begin = HostNs(since + round(dead.period_ns / 2))
        self.account.goes_on(since, last_before)

    def follow(self, after: "Recording") -> None:
        """Go on after the last pulse that is in another log."""
        self.continues = after.path.stem
        self.span = replace(after.span, over=False)
        before = after.account
        last = before.ledger.last_time
        since = before.since if last is None else before.anchor.host(last)
        self.account.goes_on(since, before.ledger.last_pulse or before.last_before)

    @property
    def _after(self) -> dict[str, str]:
        """The session field that says after which pulse it goes on."""
        return {CONTINUES_AFTER: str(self.account.last_before)}

    @property
    def id(self) -> str:
        """Id of the recording."""
        return self._order.recording

    @property
    def path(self) -> Path:
        """Path of the log."""
        return self._order.path

    @property
    def log(self) -> LogWriter | None:
        """Writes the log; None until it is open."""
        return self.opening.log

    def lasts_s(self, time: HostNs) -> float:
        """From the first pulse that was handed to the log until a time, s; 0 without one."""
        return 0.0 if self._tagger.begun is None else (time - self._tagger.begun) / NS_PER_S

    @property
    def size(self) -> int:
        """Bytes of the log with everything that was handed to it, as far as is known; its end is not in it."""
        return self._writer.size + len(self.in_flight) * self._assembler.buffers.layout.slot_bytes

    def finished(self) -> bool:
        """Whether no further pulse belongs to the recording, provided that all decided pulses were offered."""
        return self.span.ended(HostNs(self._assembler.settled - self._assembler.hold_ns))

    def hurry(self, now: HostNs) -> None:
        """Let none of its pulses wait for what later ones may tell, once its end has come."""
        if self.span.end is not None and now > self.span.end:
            self._assembler.pairer.hurry(self.span.end)

    def end_early(self, why: Phrase) -> None:
        """End with the last pulse that was handed to the log, before the recording was to end."""
        self.span.over, self.ending.early = True, why

    def tag(self, pulse: ClosedPulse) -> TripletTag:
        """The tag of the next pulse of the recording, with its number in it."""
        if self._tagger.begun is None:
            self._tagger.begin(pulse.time, self.account.first_number(pulse.time, self._order.goes_on))
        return self._tagger.tag(pulse)

    def write(self, tag: TripletTag, held: Held, slot: int | None, encoded: bytes) -> None:
        """Hand one pulse to the log. The recording keeps it too, until it is known to be in the file.

        Args:
            tag: the pulse's tag.
            held: the pulse, with the caller's hold on its triplet buffer.
            slot: the triplet buffer, None if there is none: only the tag is written.
            encoded: the tag in JSON.

        Raises:
            StorageError: writing has ended.
        """
        self.span.count(held.triplet.pulse)
        self.in_flight.add(held, tag)
        if slot is not None:
            self._assembler.buffers.hold(slot)
        self._writer.write_pulse(tag, slot, self.utc(held.ready), encoded)

    def confirm(self, now: HostNs) -> None:
        """Account for the pulses that are in the file by now, and release their triplet buffers.

        In the first seconds (`StartRecording.keep_s`) they are kept instead, in case that the recording is a mishap.
        """
        keeping = self.mishap or now < self.span.commanded + round(self._order.keep_s * NS_PER_S)
        if self.log is not None:
            self.in_flight.confirm(self.log.pulses, self.account.ledger)
        if not keeping:
            self.in_flight.forget()

    @property
    def settled(self) -> bool:
        """Whether nothing happens to the log any more, and all pulses in it are accounted for."""
        return (self.log is None or self.log.over) and self.all_written and not self.in_flight.keeps

    @property
    def all_written(self) -> bool:
        """Whether every pulse that was handed to the log is in the file."""
        return not len(self.in_flight)

    def take_back(self) -> list[Held]:
        """Remove and return the pulses that are not in the file, in order, for another log; for use after a failure."""
        left = self.in_flight.take_back()
        for held in left:
            self.span.count(held.triplet.pulse, -1)
        self.span.over = False
        return left

    @property
    def is_there(self) -> bool:
        """Whether the log is where it was made: not deleted, not moved away."""
        return not isinstance(self.ending.failure, FileVanishedError)

    def event(self, event: Event, time: HostNs) -> None:
        """Write an event that happened at `time`, on the time scale of the tags, whatever the computer's clock says.

        Raises:
            StorageError: writing has ended.
        """
        self._writer.write_event(self.dated(event, time))

    def dated(self, event: Event, time: HostNs) -> Event:
        """An event that happened at `time`, on the time scale of the tags."""
        return msgspec.structs.replace(event, time=self.utc(time))

    def health(self, health: bytes, time: HostNs) -> None:
        """Write the encoded health record of the second that ended at `time`.

        Raises:
            StorageError: writing has ended.
        """
        self._writer.write_health(health, self.utc(time))

    def result(self, result: TellResult, time: HostNs) -> None:
        """Write a result of the analysis that came at `time`.

        Raises:
            StorageError: writing has ended.
        """
        self._writer.write_message(result.topic, result.data, result.time, self.utc(time), result.pulse)

    def statistics(self) -> WritingHealth | None:
        """How writing goes; None until the log is open."""
        return None if self.log is None else self.log.statistics()

    def utc(self, time: HostNs) -> UtcNs:
        """UTC of a host time, on the same time scale as the recording's tags."""
        return self.account.anchor.utc(time)

    def end_account(self) -> None:
        """Fix the moment until which the log tells of every pulse; time without pulses before it is a pause."""
        last, span, ending = self.account.ledger.last_time, self.span, self.ending
        if (span.is_full or ending.failure is not None or ending.next_part) and last is not None:
            self.account.end(self.account.anchor.host(last))
        else:  # pulses of the last moments may be undecided
            decided = HostNs(self._assembler.settled - self._assembler.hold_ns)
            self.account.end(decided if span.end is None else min(span.end, decided))

    def begin_close(self) -> None:
        """Begin to write the end of the log, if it is open."""
        if self.log is None:
            return
        if self.account.until is None:
            self.end_account()
        if self.account.until is not None:
            fields = extent(self.utc(self.account.since), self.utc(self.account.until)) | self.ending.fields()
            if self.ending.early is None and self._order.nobody_stops and not self.span.stopped:
                fields |= {FORGOTTEN: f"{self._order.seconds or 0:.3f}"}
            self._writer.set_metadata(RECORDING_METADATA, fields)
        if self.ending.trouble is not None:
            self._writer.set_metadata(TROUBLE_METADATA, {"disk": str(self.ending.trouble)})
        if self.continues:
            self._writer.set_metadata(SESSION_METADATA, self._session | self._after)
        self._writer.begin_close()

    @property
    def part_limits(self) -> tuple[float | None, float | None]:
        """How long, s, and how large, 10^9 bytes, its log may become before it goes on in another one; None: any."""
        return self._order.part_s, self._order.part_gb

    def continuation(self, path: Path, *, part: bool = False) -> StartRecording:
        """The order for going on in another log: as the next `part`, or after a failure."""
        return msgspec.structs.replace(self._order, path=path, goes_on=None, part_of=self.id if part else "")

    def part(self) -> LogPart:
        """What became of the log."""
        summary, failure = None if self.log is None else self.log.summary, self.ending.failure
        return LogPart(
            path=self.path,
            bytes=0 if self.log is None else self.log.statistics().bytes_written,
            counts=self.account.ledger.counts(),
            closed=summary is not None and summary.closed,
            failure=None if failure is None else failure.said,
        )

    @property
    def _writer(self) -> LogWriter:
        if self.log is None:
            raise RuntimeError("the log is not open yet")
        return self.log
