"""Starts and ends recordings, one at a time, and writes into them the pulses that belong to them.

A recording that begins in the past finds hundreds of pulses in the pre-roll. They are written in slices, and between
two slices the recorder reads the frames that keep coming. Opening, writing and closing a log happen in other threads.
So the recorder's loop never stands still, whatever the disk does.

```
 opening ──► running ──► flushing ──► closing ──► finished
    │           │  all pulses  everything   the end is written
    │           ▼  are decided is in the file      ▲
    └──────► a failure: goes on in another log, or ┘
```
"""

import time
from collections.abc import Callable
from enum import Enum, auto
from typing import Final

from recorder.live import wording
from recorder.live.assembler import Assembler
from recorder.live.composer import Triplet
from recorder.live.disk_watch import DiskWatch, hung, too_full
from recorder.live.health import LatencyHistogram
from recorder.live.parts import Parts
from recorder.live.preroll import Held, Preroll
from recorder.live.pulse_writer import PulseWriter, overruns
from recorder.live.recording import Recording
from recorder.publishing.publisher import Publisher
from rig.clocks import NS_PER_S, HostNs, host_now
from rig.errors import BadInputError, NameTakenError, StorageError, SvevError
from rig.events import Event, Level
from rig.frame import FrameStatus
from rig.health import WritingHealth
from rig.phrase import Phrase, phrase
from rig.topics import JUMPER
from rig.transport.recorder_commands import StartRecording, TellResult
from rig.transport.recorder_reports import (
    RecorderEvent,
    RecorderFailed,
    RecorderReport,
    RecordingContinued,
    RecordingStarted,
)

_SLICE_NS: Final = NS_PER_S // 200
_OPEN_S: Final = 10.0  #: how long a log may take to be opened
_CLOSE_NS: Final = 10 * NS_PER_S  #: how long the end of a log may take to be written
#: How often the disk is looked at.
_LOOK_NS: Final = NS_PER_S // 5
_PAUSE_S: Final = 0.002


class _Phase(Enum):
    """What a recording is waiting for."""

    OPENING = auto()
    RUNNING = auto()
    FLUSHING = auto()  #: it has all its pulses, and waits until they are in the file
    CLOSING = auto()


class Recordings:
    """Takes every decided pulse; writes and publishes those that belong to a recording.

    Args:
        assembler: makes the triplets.
        preroll: queue of the pulses that no recording has taken yet.
        publisher: publishes every recorded pulse, every event and every health record.
        latency: counts how long pulses took that did not wait in the pre-roll.
        underruns: tells how many frames have found no free slot in their camera's ring so far.
        report: sends a report to the service process.
    """

    def __init__(
        self,
        assembler: Assembler,
        preroll: Preroll,
        publisher: Publisher,
        latency: LatencyHistogram,
        underruns: Callable[[], int],
        report: Callable[[RecorderReport], None],
    ) -> None:
        self._assembler, self._preroll = assembler, preroll
        self._publisher, self._report, self._underruns = publisher, report, underruns
        self._writer = PulseWriter(assembler.buffers, preroll, publisher, latency)
        self._recording: Recording | None = None
        self._phase = _Phase.OPENING
        self._closing_until = HostNs(0)
        self._parts = Parts(assembler)
        self._watch = DiskWatch(0.0, 0)
        self._next_look = HostNs(0)
        self._behind = False

    @property
    def running(self) -> bool:
        """Whether there is a recording that is not closed yet."""
        return self._recording is not None

    @property
    def saving(self) -> bool:
        """Whether a recording has all its pulses, and waits for the disk."""
        return self._recording is not None and self._phase in {_Phase.FLUSHING, _Phase.CLOSING}

    @property
    def pressing(self) -> bool:
        """Whether `work` has something to do at once, even if no new pulse comes."""
        return self._behind or (self._recording is not None and self._phase is not _Phase.RUNNING)

    def statistics(self) -> WritingHealth | None:
        """Figures on the writing of the log; None without a recording."""
        return None if self._recording is None else self._recording.statistics()

    def start(self, order: StartRecording) -> None:
        """Begin a recording. That its log is open, or cannot be made, is reported later.

        Raises:
            BadInputError: a recording is running already.
        """
        if self._recording is not None:
            raise BadInputError("a recording is running: stop it before starting another")
        self._parts.begin()
        self._begin(Recording(order, self._assembler))

    def stop(self, *, at_once: bool = False, keep: bool = False) -> None:
        """End the recording, if there is one, with the pulses that have fired until now.

        Args:
            at_once: do not wait for the disk.
            keep: the recording was a mishap: what is still held of its pulses belongs to the next one too.
        """
        if self._recording is None:
            return
        self._recording.span.stop(host_now())
        self._recording.mishap = keep and self._parts.is_first
        if at_once:
            self._give_up(self._recording, wording.stopped_at_once(self._recording.path), may_continue=False)

    def take(self, triplet: Triplet) -> None:
        """Take a decided pulse, the latest so far, into the pre-roll."""
        ready = host_now()
        if self._recording is None or self._phase is not _Phase.RUNNING:
            self._writer.note_latency(triplet.pulse, ready)
        self._preroll.add(triplet, ready)

    def work(self, now: HostNs) -> None:
        """Do what can be done without waiting, for some milliseconds at most."""
        recording = self._recording
        self._parts.settle(now)
        if recording is not None:
            recording.confirm(now)
            recording.in_flight.forget(least_free=self._assembler.buffers.count - self._preroll.triplets)
            writing = self._phase in {_Phase.RUNNING, _Phase.FLUSHING}
            if writing and recording.log is not None and recording.log.error is not None:
                self._fail(recording, recording.log.error)
            else:
                self._go_on(recording, now)
        if self._recording is None or self.saving:
            self._preroll.trim(now)

    def progress(self) -> None:
        """Report how far it is."""
        if self._recording is not None and self._recording.log is not None:
            self._report(self._parts.progress(self._recording))

    def happened(self, event: Event) -> None:
        """Publish an event and write it into the recording; without one, keep it for a recording with pre-roll.

        While a recording runs, subscribers get events on the time scale of its tags, as they stand in the log, even if
        the computer's clock is set meanwhile.
        """
        now = host_now()
        self._publisher.event(event if self._recording is None else self._recording.dated(event, now))
        self._note(event, now)

    def health(self, health: bytes) -> None:
        """Publish and write or keep an encoded health record likewise; end the recording if the disk is nearly full."""
        self._publisher.health(health)
        self._note(health, host_now())
        if self._recording is not None and self._phase is _Phase.RUNNING:
            self._keep_reserve(self._recording)

    def result(self, result: TellResult) -> None:
        """Publish a result of the analysis, and write it into its recording while that runs."""
        if result.topic == JUMPER.name:
            self._publisher.jumper(result.data)
        recording = self._recording
        if recording is None or recording.id != result.recording or self._phase is not _Phase.RUNNING:
            return
        try:
            recording.result(result, host_now())
        except StorageError as error:
            self._fail(recording, error)

    def wind_up(self, why: Phrase, patience_s: float) -> None:
        """End a running recording now, with all pulses that are decided, and wait for the disk.

        Args:
            why: reason, for the log.
            patience_s: longest wait, s.
        """
        deadline = host_now() + round(patience_s * NS_PER_S)
        while (recording := self._recording) is not None and host_now() < deadline:
            self.work(host_now())
            if self._recording is recording and self._phase is _Phase.RUNNING:
                said = phrase("event_ends_early", "recording ends early: {why}", why=why)
                self.happened(Event.now(Level.ERROR, "recorder", said))
                self._decide_now()
                self._write_slice(recording, until=None)
                recording.end_early(why)
            time.sleep(_PAUSE_S)
        if recording is not None:
            self._give_up(recording, wording.not_taken(recording.path, patience_s), may_continue=False)
            if self._recording is not None:
                self._finish(self._recording)

    def _begin(self, recording: Recording) -> None:
        self._recording, self._phase, self._behind = recording, _Phase.OPENING, False

    def _go_on(self, recording: Recording, now: HostNs) -> None:
        """Do the work of the present phase; go to the next one if it is done."""
        match self._phase:
            case _Phase.OPENING:
                self._await_opened(recording, now)
            case _Phase.RUNNING:
                self._write_slice(recording, until=HostNs(now + _SLICE_NS))
                self._look_at_disk(now)
                recording.hurry(now)
                if self._recording is recording and not self._behind and recording.finished():
                    self._phase = _Phase.FLUSHING
            case _Phase.FLUSHING:
                self._look_at_disk(now)
                if self._recording is recording and recording.all_written:
                    recording.end_account()
                    counts = recording.account.ledger.summary_line()
                    said = phrase("event_log_stopped", "recording stopped: {counts}", counts=counts)
                    self.happened(Event.now(Level.INFO, "recorder", said))
                    self._close(recording, now, _CLOSE_NS)
            case _Phase.CLOSING:
                if now > self._closing_until or self._parts.over(recording):
                    self._finish(recording)

    def _await_opened(self, recording: Recording, now: HostNs) -> None:
        try:
            if recording.opening.opened():
                self._opened(recording)
            elif recording.opening.takes_s(now) > _OPEN_S:
                self._give_up(recording, wording.not_made(recording.path.parent, _OPEN_S), may_continue=True)
        except SvevError as error:
            self._fail(recording, error)

    def _opened(self, recording: Recording) -> None:
        self._phase = _Phase.RUNNING
        rig = self._assembler.rig
        self._watch = DiskWatch(rig.triplet_bytes * rig.trigger.rate_hz, self._underruns())
        said = wording.started(recording.id)
        if self._parts.earlier:
            before = self._parts.earlier[-1]
            said = (
                wording.next_part(recording.id, recording.path)
                if before.ending.next_part
                else wording.goes_on(before.path.stem, recording.path.stem, before.ending.failure)
            )
            self._report(RecordingContinued(path=recording.path, before=before.part()))
        else:
            if recording.continues:
                said = wording.goes_on(recording.continues, recording.id, None)
            first = self._preroll.first_since(recording.span.begin)
            self._report(RecordingStarted(first_pulse=None if first is None else recording.utc(first)))
        for time_, note in self._preroll.take_notes(since=recording.span.begin):
            self._note(note, time_)
        self.happened(Event.now(Level.INFO, "recorder", said))

    def _close(self, recording: Recording, now: HostNs, patience_ns: int) -> None:
        self._note_trouble(recording)
        self._parts.drop_following()
        if self._recording is recording:
            self._phase, self._closing_until = _Phase.CLOSING, HostNs(now + patience_ns)
            recording.begin_close()

    def _note_trouble(self, recording: Recording) -> None:
        """Note in an ending log what its disk cost."""
        recording.ending.trouble = self._watch.trouble(recording.account.ledger.failed.causes[FrameStatus.LOST])

    def _finish(self, recording: Recording) -> None:
        """Report the end of the recording."""
        self._recording = None
        self._parts.let_go(recording)
        if recording.mishap and recording.ending.failure is None:
            self._preroll.put_back(recording.in_flight.take_kept())
        self._report(self._parts.finished(recording, self._publisher.dropped))

    def _give_up(self, recording: Recording, error: StorageError, *, may_continue: bool) -> None:
        """End a log whose disk hangs, without waiting for the disk."""
        recording.opening.give_up(error)
        self._fail(recording, error, may_continue=may_continue, patience_ns=0)

    def _fail(
        self,
        recording: Recording,
        error: SvevError,
        *,
        may_continue: bool = True,
        whole: bool = False,
        patience_ns: int = _CLOSE_NS,
    ) -> None:
        """Go on in another log if there is a place for one; otherwise end the recording.

        Args:
            recording: the recording.
            error: why its log ends.
            may_continue: whether to look for a place for another log.
            whole: the log still takes what was handed to it.
            patience_ns: how long to wait until the log is closed.
        """
        recording.ending.failure = error if isinstance(error, StorageError) else None
        recording.ending.early = error.said
        recording.mishap = False
        recording.in_flight.forget()
        taken = isinstance(error, NameTakenError)  # the service orders the recording again under another name
        event = Event.now(Level.WARNING if taken else Level.FATAL, "recorder", error.said)
        self._publisher.event(recording.dated(event, host_now()))
        self._note_trouble(recording)
        self._parts.drop_following()
        if not whole:
            self._preroll.put_back(recording.take_back())
        path = self._parts.next_path(recording, error) if may_continue else None
        if path is not None:
            recording.ending.early = wording.goes_on_in(path, error)
            event = Event.now(Level.ERROR, "disk", recording.ending.early)
            self._report(RecorderEvent(event=event))
            self._parts.earlier.append(recording)
            recording.begin_close()
            self._begin(Recording(recording.continuation(path), self._assembler, after=recording))
        elif recording.log is None:
            self._recording = None
            self._refuse(error)
        elif whole:
            self._phase = _Phase.FLUSHING
        else:
            self._close(recording, host_now(), patience_ns)

    def _refuse(self, error: SvevError) -> None:
        """Report that a log could not be made."""
        if self._parts.earlier:
            said = phrase("event_there_neither", "there neither: {why}", why=error.said)
            self._report(RecorderEvent(event=Event.now(Level.ERROR, "disk", said)))
            self._finish(self._parts.earlier.pop())
        else:
            self._report(RecorderFailed.of(error))

    def _look_at_disk(self, now: HostNs) -> None:
        recording = self._recording
        if recording is None or recording.log is None or now < self._next_look:
            return
        self._next_look = HostNs(now + _LOOK_NS)
        behind = self._assembler.backlog and self._phase is _Phase.RUNNING
        for event in self._watch.look(now, recording.log, behind=behind, underruns=self._underruns()):
            self.happened(event)
            self._report(RecorderEvent(event=event))
        error = hung(recording.path, recording.log, other_disk=self._parts.other_folder(recording) is not None)
        if self._recording is recording and error is not None:
            self._give_up(recording, error, may_continue=True)

    def _keep_reserve(self, recording: Recording) -> None:
        """End the log while there is still room to close it."""
        why = None if recording.log is None else too_full(recording.log, self._assembler.rig.recorder.reserve_gb)
        if why is None:
            return
        self.happened(Event.now(Level.ERROR, "recorder", why))
        if self._recording is recording and self._phase is _Phase.RUNNING:
            self._fail(recording, wording.reserve_reached(recording.path, why), whole=True)

    def _decide_now(self) -> None:
        """Take in the pulses that would have waited for the evidence of later ones."""
        now = host_now()
        self._assembler.pairer.hurry(now)
        for triplet in self._assembler.pump(now):
            self.take(triplet)

    def _note(self, note: Event | bytes, time_: HostNs) -> None:
        """Write an event or an encoded health record into the log that runs; keep it for the next one otherwise."""
        recording = self._recording
        takes = self._phase is _Phase.RUNNING or (self._phase is _Phase.FLUSHING and isinstance(note, Event))
        if recording is None or not takes:
            self._preroll.note(time_, note)
            return
        try:
            if isinstance(note, Event):
                recording.event(note, time_)
            else:
                recording.health(note, time_)
        except StorageError as error:
            self._fail(recording, error)

    def _write_slice(self, recording: Recording, until: HostNs | None) -> None:
        """Move pulses from the pre-roll into the recording until the time `until`; None: all of them."""
        self._behind = False
        while self._recording is recording and self._phase is _Phase.RUNNING:
            held = self._preroll.oldest
            if held is None or recording.span.ends_before(held.triplet.pulse):
                return
            if held.triplet.pulse.time < recording.span.begin:
                self._preroll.drop()
                continue
            now = host_now()
            self._behind = until is not None and (now > until or self._writer.lags(recording, held, now))
            if self._behind or self._turns_over(recording, held):
                return
            self._write(recording, self._preroll.take())

    def _turns_over(self, recording: Recording, held: Held) -> bool:
        """Whether a pulse belongs to the next part of the recording, and that begins as soon as it can.

        Until its log is open the present one takes the pulses. Then they wait, for some milliseconds, until all of the
        present log are in the file: whatever the disk does, each pulse is in one of the two.
        """
        time_ = held.triplet.pulse.time
        following = self._parts.following(recording, time_)
        if following is None:
            return False
        try:
            if not following.opening.opened():
                return False
        except SvevError as error:
            self._parts.refuse(recording, time_, error)
            event = Event.now(Level.WARNING, "disk", wording.no_next_part(following.path, error))
            self.happened(event)
            self._report(RecorderEvent(event=event))
            return self._recording is not recording
        if recording.all_written:
            self._note_trouble(recording)
            self._parts.turn_over(recording, following)
            self._begin(following)
            self._opened(following)
        self._behind = True
        return True

    def _write(self, recording: Recording, held: Held) -> None:
        tag = recording.tag(held.triplet.pulse)
        try:
            self._writer.write(recording, tag, held)
        except StorageError as error:
            self._fail(recording, error)
        for event in overruns(tag, held.triplet.pulse):
            self.happened(event)
