"""One recording: which pulses belong to it, their numbers and tags, and its log. Nothing here waits for the disk."""

import threading
from collections import deque
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

import msgspec

from recorder.live.assembler import Assembler
from recorder.live.opening import discard, discard_in_background, in_background, open_log
from recorder.live.preroll import Held
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
from rig.phrase import Phrase, phrase
from rig.pulse import PulseNumber
from rig.tag import TripletTag
from rig.topics import RECORDING_METADATA, SESSION_METADATA, TROUBLE_METADATA
from rig.transport.recorder_commands import GoesOn, StartRecording, TellResult
from rig.transport.recorder_reports import LogPart
from triggering.ledger.account import Ledger
from triggering.pairing.pairer import ClosedPulse

#: A pulse generator may be slower than the rig file says by this share: the recording still gets all its pulses.
_SLOW: Final = 0.01


@dataclass(frozen=True, slots=True)
class _InFlight:
    """A pulse that was handed to the log and is not known to be in the file yet."""

    held: Held
    tag: TripletTag


class Recording:
    """Writes pulses into one log, numbered from 1, or from where the log before it ends.

    The log is opened in the background. `log` is None until then.

    Args:
        order: what to record.
        assembler: makes the triplets.
        after: a recording whose log failed, or is as large as a part may be, and which this one continues.
        part: which part of a split recording the log is; from the second one on, `after` takes pulses until `follow`.

    Raises:
        BadInputError: the names of session and recording are too long for the log.

    Attributes:
        commanded: when the command to start came.
        begin: time of the first pulse that may belong to the recording; may be before `commanded`.
        ledger: what became of the pulses that are in the file.
        log: writes the log; None until it is open.
        failure: the error that ended the log before its time, None if there was none.
        early: why the log ends before the recording was to end, for the log; None: it does not.
        trouble: what went wrong with the disk without ending the log; None: nothing.
        continues: id of the recording that this one continues, empty if none.
        mishap: whether it was stopped as soon as it had begun: its pulses belong to the next recording too.
        next_part: id of the log in which it goes on when this one is as large as a part may be; empty: in none.
    """

    def __init__(
        self, order: StartRecording, assembler: Assembler, after: "Recording | None" = None, part: int = 1
    ) -> None:
        rig, session_name = assembler.rig, order.session.get("session", "")
        check_tag_fits(assembler.buffers.layout, [camera.name for camera in rig.cameras], session_name, order.recording)
        self._order, self._assembler = order, assembler
        self._anchor: UtcAnchor = UtcAnchor.take() if after is None or part == 1 else after._anchor
        self.failure: StorageError | None = None
        self.early: Phrase | None = None
        self.trouble: Phrase | None = None
        self.continues = self.next_part = ""
        self.ledger = Ledger()
        self._handed = 0
        self._in_flight: deque[_InFlight] = deque()
        self._kept: deque[Held] = deque()
        self._ended = self._stopped = self.mishap = False
        self._last_before = self._first = PulseNumber(0)
        self._begun: HostNs | None = None
        self._account_until: HostNs | None = None
        if after is None:
            self._begin(order)
            self._follow(self._last_before)
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
            begin=self._anchor.utc(host_now()),
        )
        self.log: LogWriter | None = None
        self._opening = in_background(partial(open_log, order.path, description, assembler.buffers))
        self._opening_since = host_now()

    def _begin(self, order: StartRecording) -> None:
        back = order.preroll_s
        given = host_now() if order.commanded is None else order.commanded
        self.commanded = given if order.goes_on is None else order.goes_on.commanded
        self.begin = HostNs(0 if back is None else self.commanded - round(back * NS_PER_S))
        self._end = self._planned_end()
        self._since_command = 0
        self._account_from = self.commanded
        if order.goes_on is not None:
            self._take_over(order.goes_on)

    def _take_over(self, recording: GoesOn) -> None:
        """Go on after the last pulse of a recorder that died."""
        self.continues, self._last_before = recording.recording, recording.pulse
        if recording.time is not None:
            self._account_from = self._anchor.host(recording.time)
            self.begin = HostNs(self._account_from + round(recording.period_ns / 2))

    def follow(self, after: "Recording") -> None:
        """Go on after the last pulse that is in another log."""
        self.continues = after.path.stem
        self.commanded, self.begin, self._end = after.commanded, after.begin, after._end
        self._since_command = after._since_command
        last = after.ledger.last_time
        self._account_from = after._account_from if last is None else after._anchor.host(last)
        self._follow(after.ledger.last_pulse or after._last_before)

    def _follow(self, last_before: PulseNumber) -> None:
        self._last_before = last_before
        self.ledger.follows(last_before)
        self._tell_ledger()

    @property
    def _after(self) -> dict[str, str]:
        """The session field that says after which pulse it goes on."""
        return {CONTINUES_AFTER: str(self._last_before)}

    def _first_number(self, time: HostNs) -> PulseNumber:
        """Number of the log's first pulse: those that fired while there was no recorder are counted by time."""
        dead, periods = self._order.goes_on, 1
        if dead is not None and dead.time is not None:
            periods = max(1, round((time - self._account_from) / dead.period_ns))
        return PulseNumber(self._last_before + periods)

    def _planned_end(self) -> HostNs | None:
        order, period = self._order, self._assembler.rig.trigger.period_ns
        if order.seconds is None:
            return None
        # If the pulses are counted, the clock only ends a recording whose pulses come too slowly or stop coming.
        grace = 0 if order.pulses is None else round(order.seconds * NS_PER_S * _SLOW) + 2 * period
        return HostNs(self.commanded + round(order.seconds * NS_PER_S) + grace)

    @property
    def id(self) -> str:
        """Id of the recording."""
        return self._order.recording

    @property
    def path(self) -> Path:
        """Path of the log."""
        return self._order.path

    def opened(self) -> bool:
        """Whether the log is open by now.

        Raises:
            SvevError: it cannot be made.
        """
        if self.log is None and self._opening.done():
            self.log = self._opening.result()
        return self.log is not None

    def opening_s(self, now: HostNs) -> float:
        """For how long it has been being opened, s."""
        return (now - self._opening_since) / NS_PER_S

    def give_up(self, error: StorageError) -> None:
        """Do not wait for the disk any longer; a log that is opened only now is removed again."""
        if self.log is None:
            self._opening.add_done_callback(partial(discard, error))
        else:
            self.log.give_up(error)

    def discard(self) -> threading.Thread:
        """Remove the log again, which has no pulse; the thread that is returned ends when that is done."""
        return discard_in_background(StorageError(f"{self.path}: no pulse came for this part"), self._opening)

    def lasts_s(self, time: HostNs) -> float:
        """From the first pulse that was handed to the log until a time, s; 0 without one."""
        return 0.0 if self._begun is None else (time - self._begun) / NS_PER_S

    @property
    def size(self) -> int:
        """Bytes of the log with everything that was handed to it, as far as is known; its end is not in it."""
        return self._writer.size + len(self._in_flight) * self._assembler.buffers.layout.slot_bytes

    def finished(self) -> bool:
        """Whether no further pulse belongs to the recording, provided that all decided pulses were offered."""
        settled = self._assembler.settled
        return self._ended or self._counted or (self._end is not None and settled > self._end + self._assembler.hold_ns)

    def hurry(self, now: HostNs) -> None:
        """Let none of its pulses wait for what later ones may tell, once its end has come."""
        if self._end is not None and now > self._end:
            self._assembler.pairer.hurry(self._end)

    def stop(self) -> None:
        """End with the last pulse that has fired until now, or before if that was planned."""
        now = host_now()
        self._end, self._stopped = now if self._end is None else min(self._end, now), True

    def end_early(self, why: Phrase) -> None:
        """End with the last pulse that was handed to the log, before the recording was to end."""
        self._ended, self.early = True, why

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
        if not self._handed:
            self._first, self._begun = self._first_number(pulse.time), pulse.time
        number, time = PulseNumber(self._first + self._handed), self._anchor.utc(pulse.time)
        rig = self._assembler.rig
        return TripletTag.made(number, time, session, self.id, rig.triplet_shape, cameras, rig.pixels)

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
        self._handed += 1
        self._since_command += held.triplet.pulse.time >= self.commanded
        self._in_flight.append(_InFlight(held, tag))
        if slot is not None:
            self._assembler.buffers.hold(slot)
        self._writer.write_pulse(tag, slot, self._anchor.utc(held.ready), encoded)

    def confirm(self, now: HostNs) -> None:
        """Account for the pulses that are in the file by now, and release their triplet buffers.

        In the first seconds (`StartRecording.keep_s`) they are kept instead, in case that the recording is a mishap.
        """
        keeping = self.mishap or now < self.commanded + round(self._order.keep_s * NS_PER_S)
        while self.log is not None and self._in_flight and self.ledger.pulses < self.log.pulses:
            done = self._in_flight.popleft()
            self.ledger.add(done.tag)
            self._kept.append(done.held)
        if not keeping:
            self.forget()

    def forget(self, least_free: int | None = None) -> None:
        """Release the triplet buffers of pulses that were kept, the oldest first.

        Args:
            least_free: only until so many buffers are free; None: all of them.
        """
        buffers = self._assembler.buffers
        while self._kept and (least_free is None or buffers.free_count < least_free):
            slot = self._kept.popleft().triplet.slot
            if slot is not None:
                buffers.release(slot)

    def take_kept(self) -> list[Held]:
        """Remove and return the pulses that were kept, oldest first; their slots are the caller's."""
        kept = list(self._kept)
        self._kept.clear()
        return kept

    @property
    def settled(self) -> bool:
        """Whether nothing happens to the log any more, and all pulses in it are accounted for."""
        return (self.log is None or self.log.over) and self.all_written and not self._kept

    @property
    def all_written(self) -> bool:
        """Whether every pulse that was handed to the log is in the file."""
        return not self._in_flight

    def take_back(self) -> list[Held]:
        """Remove and return the pulses that are not in the file, in order, for another log; for use after a failure."""
        left = [pulse.held for pulse in self._in_flight]
        self._in_flight.clear()
        self._since_command -= sum(held.triplet.pulse.time >= self.commanded for held in left)
        self._ended = False
        return left

    def release(self) -> None:
        """Release the triplet buffers of the pulses that are not in the file and never will be."""
        for held in self.take_back():
            if held.triplet.slot is not None:
                self._assembler.buffers.release(held.triplet.slot)

    @property
    def is_there(self) -> bool:
        """Whether the log is where it was made: not deleted, not moved away."""
        return not isinstance(self.failure, FileVanishedError)

    def unclosed(self) -> StorageError | None:
        """The error that the log has come to its end without being closed; None if it is closed."""
        if self.log is None or ((summary := self.log.summary) is not None and summary.closed):
            return None
        text = "{path}: the disk did not take the end of the log; what is written so far stays readable: svev recover"
        return self.log.error or StorageError(phrase("why_not_closed", text, path=str(self.path)))

    def event(self, event: Event, time: HostNs) -> None:
        """Write an event that happened at `time`, on the time scale of the tags, whatever the computer's clock says.

        Raises:
            StorageError: writing has ended.
        """
        self._writer.write_event(self.dated(event, time))

    def dated(self, event: Event, time: HostNs) -> Event:
        """An event that happened at `time`, on the time scale of the tags."""
        return msgspec.structs.replace(event, time=self._anchor.utc(time))

    def health(self, health: bytes, time: HostNs) -> None:
        """Write the encoded health record of the second that ended at `time`.

        Raises:
            StorageError: writing has ended.
        """
        self._writer.write_health(health, self._anchor.utc(time))

    def result(self, result: TellResult, time: HostNs) -> None:
        """Write a result of the analysis that came at `time`.

        Raises:
            StorageError: writing has ended.
        """
        self._writer.write_message(result.topic, result.data, result.time, self._anchor.utc(time), result.pulse)

    def statistics(self) -> WritingHealth | None:
        """How writing goes; None until the log is open."""
        return None if self.log is None else self.log.statistics()

    def utc(self, time: HostNs) -> UtcNs:
        """UTC of a host time, on the same time scale as the recording's tags."""
        return self._anchor.utc(time)

    def end_account(self) -> None:
        """Fix the moment until which the log tells of every pulse; time without pulses before it is a pause."""
        last = self.ledger.last_time
        if (self._counted or self.failure is not None or self.next_part) and last is not None:
            self._account_until = self._anchor.host(last)
        else:  # pulses of the last moments may be undecided
            decided = HostNs(self._assembler.settled - self._assembler.hold_ns)
            self._account_until = decided if self._end is None else min(self._end, decided)
        self._tell_ledger()

    def _tell_ledger(self) -> None:
        until = None if self._account_until is None else self.utc(self._account_until)
        self.ledger.lasted(self.utc(self._account_from), until, self._assembler.rig.trigger.period_ns)

    def begin_close(self) -> None:
        """Begin to write the end of the log, if it is open."""
        if self.log is None:
            return
        if self._account_until is None:
            self.end_account()
        if self._account_until is not None:
            fields = extent(self.utc(self._account_from), self.utc(self._account_until))
            if self.early is not None:
                fields |= {ENDED_EARLY: str(self.early), ENDED_EARLY_SAID: as_field(self.early)}
            elif self._order.nobody_stops and not self._stopped:
                fields |= {FORGOTTEN: f"{self._order.seconds or 0:.3f}"}
            if self.next_part:
                fields |= {NEXT_PART: self.next_part}
            if self.trouble is not None:
                fields |= {DISK_SAID: as_field(self.trouble)}
            self._writer.set_metadata(RECORDING_METADATA, fields)
        if self.trouble is not None:
            self._writer.set_metadata(TROUBLE_METADATA, {"disk": str(self.trouble)})
        if self.continues:
            self._writer.set_metadata(SESSION_METADATA, self._session | self._after)
        self._writer.begin_close()

    @property
    def part_limits(self) -> tuple[float | None, float | None]:
        """How long, s, and how large, 10^9 bytes, its log may become before it goes on in another one; None: any."""
        return self._order.part_s, self._order.part_gb

    def continuation(self, path: Path, *, part: bool = False) -> StartRecording:
        """The order for a recording that continues this one in another log, which is its next `part` or not."""
        return msgspec.structs.replace(self._order, path=path, goes_on=None, part_of=self.id if part else "")

    def part(self) -> LogPart:
        """What became of the log."""
        summary = None if self.log is None else self.log.summary
        return LogPart(
            path=self.path,
            bytes=0 if self.log is None else self.log.statistics().bytes_written,
            counts=self.ledger.counts(),
            closed=summary is not None and summary.closed,
            failure=None if self.failure is None else self.failure.said,
        )

    @property
    def _writer(self) -> LogWriter:
        if self.log is None:
            raise RuntimeError("the log is not open yet")
        return self.log
