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
from pathlib import Path
from typing import Final

from recorder.live.assembler import Assembler, Triplet
from recorder.live.disk_watch import HANGS_S, DiskWatch
from recorder.live.health import LatencyHistogram
from recorder.live.preroll import Held, Preroll
from recorder.live.recording import Recording
from recorder.publishing.publisher import Publisher
from rig.clocks import NS_PER_S, HostNs, UtcNs, host_now
from rig.errors import BadInputError, FileVanishedError, StorageError, SvevError
from rig.events import Event, Level
from rig.frame import FrameStatus
from rig.health import WritingHealth
from rig.pulse import Pause
from rig.status import Counts
from rig.tag import TripletTag
from rig.topics import JUMPER
from rig.transport.messages import (
    RecorderEvent,
    RecorderFailed,
    RecorderReport,
    RecordingContinued,
    RecordingFinished,
    RecordingProgress,
    RecordingStarted,
    StartRecording,
    TellResult,
)
from triggering.ledger import Ledger
from triggering.pairing.pairer import ClosedPulse

_SLICE_NS: Final = NS_PER_S // 200
#: How long after its start a recording waits for subscribers that take its pre-roll more slowly than the disk does.
_PATIENCE_NS: Final = 10 * NS_PER_S
#: How long a log may take to be opened, s.
_OPEN_S: Final = 10.0
#: A log whose disk has taken nothing for so long is given up, s.
_HUNG_S: Final = 30.0
#: The same if there is another disk: before the frames no longer fit into memory.
_HUNG_WITH_FALLBACK_S: Final = 2 * HANGS_S
#: How long the end of a log may take to be written, s.
_CLOSE_NS: Final = 10 * NS_PER_S
#: How often the disk is looked at.
_LOOK_NS: Final = NS_PER_S // 5
_PAUSE_S: Final = 0.002
#: A recording has so many logs at most, however often one of them fails.
_PARTS_MAX: Final = 20

#: Sends a report to the parent process.
Report = Callable[[RecorderReport], None]


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
        report: Report,
    ) -> None:
        self._assembler, self._buffers, self._preroll = assembler, assembler.buffers, preroll
        self._publisher, self._latency, self._report = publisher, latency, report
        self._underruns = underruns
        self._recording: Recording | None = None
        self._phase = _Phase.OPENING
        self._closing_until = HostNs(0)
        self._earlier: list[Recording] = []
        self._watch = DiskWatch(0.0, 0)
        self._next_look = HostNs(0)
        self._behind = False

    @property
    def running(self) -> bool:
        """Whether a recording is being opened, is running or is being closed."""
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
        self._earlier.clear()
        self._begin(Recording(order, self._assembler))

    def stop(self, *, at_once: bool = False, keep: bool = False) -> None:
        """End the recording, if there is one, with the pulses that have fired until now.

        Args:
            at_once: do not wait for the disk.
            keep: the recording was a mishap: what is still held of its pulses belongs to the next one too.
        """
        if self._recording is None:
            return
        self._recording.stop()
        self._recording.mishap = keep and not self._earlier
        if at_once:
            text = "it was stopped without waiting for the disk; what the disk had taken stays readable"
            self._give_up(self._recording, StorageError(f"{self._recording.path}: {text}"), may_continue=False)

    def take(self, triplet: Triplet) -> None:
        """Take a decided pulse, the latest so far, into the pre-roll."""
        ready = host_now()
        if self._recording is None or self._phase is not _Phase.RUNNING:
            self._note_latency(triplet.pulse, ready)
        self._preroll.add(triplet, ready)

    def work(self, now: HostNs) -> None:
        """Do what can be done without waiting, for some milliseconds at most."""
        recording = self._recording
        for each in (*self._earlier, *([] if recording is None else [recording])):
            each.confirm(now)
        if recording is not None:
            recording.forget(least_free=self._buffers.count - self._preroll.triplets)
            writing = self._phase in {_Phase.RUNNING, _Phase.FLUSHING}
            if writing and recording.log is not None and recording.log.error is not None:
                self._fail(recording, recording.log.error)
            else:
                self._go_on(recording, now)
        if self._recording is None or self.saving:
            self._preroll.trim(now)

    def progress(self) -> None:
        """Report how far the recording is."""
        if self._recording is not None and self._recording.log is not None:
            counts, first = self._counts(self._recording), self._first_pulse(self._recording)
            self._report(RecordingProgress(counts=counts, first_pulse=first, pauses=self._pauses(self._recording)))

    def happened(self, event: Event) -> None:
        """Publish an event and write it into the recording; without one, keep it for a recording with pre-roll."""
        self._publisher.event(event)
        self._note(event, host_now())

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

    def wind_up(self, why: str, patience_s: float) -> None:
        """End a running recording now, with all pulses that are decided, and wait for the disk.

        Args:
            why: reason, for the log.
            patience_s: longest wait, s.
        """
        deadline = host_now() + round(patience_s * NS_PER_S)
        while (recording := self._recording) is not None and host_now() < deadline:
            self.work(host_now())
            if self._recording is recording and self._phase is _Phase.RUNNING:
                self.happened(Event.now(Level.ERROR, "recorder", f"recording ends early: {why}"))
                self._decide_now()
                self._write_slice(recording, until=None)
                recording.end_now()
            time.sleep(_PAUSE_S)
        if recording is not None:
            text = f"the disk has not taken the rest within {patience_s:g} s; look at `dmesg`"
            self._give_up(recording, StorageError(f"{recording.path}: {text}"), may_continue=False)
            if self._recording is not None:
                self._finish(self._recording)

    # -- from phase to phase -------------------------------------------------------------------------------------

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
                    summary = recording.ledger.summary_line()
                    self.happened(Event.now(Level.INFO, "recorder", f"recording stopped: {summary}"))
                    self._close(recording, now, _CLOSE_NS)
            case _Phase.CLOSING:
                logs = [each.log for each in (*self._earlier, recording)]
                if now > self._closing_until or all(log is None or log.over for log in logs):
                    self._finish(recording)

    def _await_opened(self, recording: Recording, now: HostNs) -> None:
        try:
            if recording.opened():
                self._opened(recording)
            elif recording.opening_s(now) > _OPEN_S:
                text = f"the disk does not let a file be made within {_OPEN_S:g} s; look at `dmesg`"
                error = StorageError(f"{recording.path.parent}: {text}, record to another disk")
                self._give_up(recording, error, may_continue=True)
        except SvevError as error:
            self._fail(recording, error)

    def _opened(self, recording: Recording) -> None:
        self._phase = _Phase.RUNNING
        rows, columns = self._buffers.shape
        wanted = rows * columns * self._assembler.rig.trigger.rate_hz
        self._watch = DiskWatch(wanted, self._underruns())
        text = f"recording {recording.id} started"
        if self._earlier:
            before = self._earlier[-1]
            text = f"recording {before.id} goes on as {recording.id}: {before.failure}"
            self._report(RecordingContinued(path=recording.path, before=before.part()))
        else:
            held = (held.triplet.pulse.time for held in self._preroll)
            first = next((time for time in held if time >= recording.begin), None)
            self._report(RecordingStarted(first_pulse=None if first is None else recording.utc(first)))
        for time_, note in self._preroll.take_notes(since=recording.begin):
            self._note(note, time_)
        self.happened(Event.now(Level.INFO, "recorder", text))

    def _close(self, recording: Recording, now: HostNs, patience_ns: int) -> None:
        recording.trouble = self._watch.trouble(recording.ledger.causes[FrameStatus.LOST])
        if self._recording is recording:
            self._phase, self._closing_until = _Phase.CLOSING, HostNs(now + patience_ns)
            recording.begin_close()

    def _finish(self, recording: Recording) -> None:
        """Report the end of the recording."""
        self._recording = None
        recording.confirm(host_now())
        for each in (recording, *self._earlier):
            each.release()
        if recording.failure is None:
            recording.failure = recording.unclosed()
        if recording.mishap and recording.failure is None:
            self._preroll.put_back(recording.take_kept())
        for each in (recording, *self._earlier):
            each.forget()
        parts = [each.part() for each in self._earlier]
        gone = next((each.failure for each in self._earlier if isinstance(each.failure, FileVanishedError)), None)
        failure = recording.failure or gone
        self._report(
            RecordingFinished(
                path=recording.path,
                bytes=recording.part().bytes,
                unpublished=self._publisher.dropped,
                counts=self._counts(recording),
                first_pulse=self._first_pulse(recording),
                pauses=self._pauses(recording),
                earlier=tuple(parts),
                failure=None if failure is None else RecorderFailed.of(failure),
                trouble="; ".join(each.trouble for each in (*self._earlier, recording) if each.trouble),
            )
        )
        self._earlier.clear()

    def _ledgers(self, recording: Recording) -> list[Ledger]:
        """The accounts of all logs that are there."""
        return [each.ledger for each in (*self._earlier, recording) if each.is_there]

    def _counts(self, recording: Recording) -> Counts:
        return Counts.sum(ledger.counts() for ledger in self._ledgers(recording))

    def _first_pulse(self, recording: Recording) -> UtcNs | None:
        times = (ledger.first_time for ledger in self._ledgers(recording))
        return next((time_ for time_ in times if time_ is not None), None)

    def _pauses(self, recording: Recording) -> tuple[Pause, ...]:
        """Each with the pulse numbers of its own log."""
        return tuple(pause for ledger in self._ledgers(recording) for pause in ledger.pauses())

    # -- failures ------------------------------------------------------------------------------------------------

    def _give_up(self, recording: Recording, error: StorageError, *, may_continue: bool) -> None:
        """End a log whose disk hangs, without waiting for the disk."""
        recording.give_up(error)
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
        recording.failure = error if isinstance(error, StorageError) else None
        recording.mishap = False
        recording.forget()
        self._publisher.event(Event.now(Level.FATAL, "recorder", str(error)))
        recording.trouble = self._watch.trouble(recording.ledger.causes[FrameStatus.LOST])
        if not whole:
            self._preroll.put_back(recording.take_back())
        path = self._next_path(recording, error) if may_continue else None
        if path is not None:
            event = Event.now(Level.ERROR, "disk", f"{error}; the recording goes on in {path}")
            self._report(RecorderEvent(event=event))
            self._earlier.append(recording)
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
        if self._earlier:
            self._report(RecorderEvent(event=Event.now(Level.ERROR, "disk", f"there neither: {error}")))
            self._finish(self._earlier.pop())
        else:
            self._report(RecorderFailed.of(error))

    def _next_path(self, recording: Recording, error: SvevError) -> Path | None:
        """Where to go on after a failure; None: nowhere.

        After a file has vanished its own folder is as good as before; it is made again if need be.
        """
        folder: Path | None = None
        if isinstance(error, FileVanishedError):
            folder = recording.path.parent
        elif isinstance(error, StorageError):
            folder = self._other_folder(recording)
        part = len(self._earlier) + 2
        if folder is None or part > _PARTS_MAX:
            return None
        first = self._earlier[0] if self._earlier else recording
        return folder / f"{first.id}-part{part}{recording.path.suffix}"

    def _other_folder(self, recording: Recording) -> Path | None:
        """The folder on another disk; None if there is none, or if the log is there already."""
        fallback = self._assembler.rig.recorder.fallback_directory
        return None if fallback == recording.path.parent else fallback

    def _look_at_disk(self, now: HostNs) -> None:
        recording = self._recording
        if recording is None or recording.log is None or now < self._next_look:
            return
        self._next_look = HostNs(now + _LOOK_NS)
        behind = self._assembler.backlog and self._phase is _Phase.RUNNING
        for event in self._watch.look(now, recording.log, behind=behind, underruns=self._underruns()):
            self.happened(event)
            self._report(RecorderEvent(event=event))
        stalled = recording.log.stalled_s()
        patience_s = _HUNG_S if self._other_folder(recording) is None else _HUNG_WITH_FALLBACK_S
        if self._recording is recording and stalled > patience_s:
            text = f"the disk has taken nothing for {stalled:.0f} s; look at `dmesg`, record to another disk"
            self._give_up(recording, StorageError(f"{recording.path}: {text}"), may_continue=True)

    def _keep_reserve(self, recording: Recording) -> None:
        """End the log while there is still room to close it."""
        reserve = self._assembler.rig.recorder.reserve_gb
        free = None if recording.log is None else recording.log.free_bytes
        if free is None or free >= reserve * 1e9:
            return
        why = f"only {free / 1e9:.1f} GB are free and {reserve:g} GB are kept in reserve: recording stopped; make room"
        self.happened(Event.now(Level.ERROR, "recorder", why))
        if self._recording is recording and self._phase is _Phase.RUNNING:
            error = StorageError(f"{recording.path}: {why}; the log is whole up to there")
            self._fail(recording, error, whole=True)

    def _decide_now(self) -> None:
        """Take in the pulses that would have waited for what later ones may tell."""
        now = host_now()
        self._assembler.pairer.hurry(now)
        for triplet in self._assembler.pump(now):
            self.take(triplet)

    # -- pulses and notes ----------------------------------------------------------------------------------------

    def _note(self, note: Event | bytes, time_: HostNs) -> None:
        """Write an event or an encoded health record into the log that runs; keep it for the next one otherwise."""
        recording = self._recording
        takes = self._phase is _Phase.RUNNING or (self._phase is _Phase.FLUSHING and isinstance(note, Event))
        if recording is None or not takes:
            self._preroll.note(time_, note)
            return
        try:
            if isinstance(note, Event):
                recording.event(note)
            else:
                recording.health(note, time_)
        except StorageError as error:
            self._fail(recording, error)

    def _write_slice(self, recording: Recording, until: HostNs | None) -> None:
        """Move pulses from the pre-roll into the recording until the time `until`; None: all of them."""
        self._behind = False
        while self._recording is recording and self._phase is _Phase.RUNNING:
            held = self._preroll.oldest
            if held is None or recording.is_over(held.triplet.pulse):
                return
            if held.triplet.pulse.time < recording.begin:
                self._preroll.drop()
                continue
            now = host_now()
            self._behind = until is not None and (now > until or self._subscribers_lag(recording, held, now))
            if self._behind:
                return
            self._write(recording, self._preroll.take())

    def _subscribers_lag(self, recording: Recording, held: Held, now: HostNs) -> bool:
        """Whether to pause the pre-roll, since subscribers would miss pulses that come faster than they take them."""
        if held.triplet.pulse.time >= recording.commanded or now > recording.commanded + _PATIENCE_NS:
            return False
        in_flight = self._buffers.count - self._preroll.triplets
        # No pause once half of the buffers for new frames are taken: subscribers may be slower than the cameras.
        return self._publisher.busy and self._buffers.free_count > in_flight // 2

    def _write(self, recording: Recording, held: Held) -> None:
        pulse, slot = held.triplet.pulse, held.triplet.slot
        # No frame came at all: a black triplet, unless no camera was there, which may last for hours.
        black = self._buffers.acquire() if slot is None and not pulse.unwatched else None
        if black is not None:
            self._buffers.write(black, 0)
            slot = black
        tag = recording.tag(pulse)
        encoded = tag.encode()
        self._publisher.triplet(encoded, self._buffers, slot)
        try:
            recording.write(tag, held, slot, encoded)
        except StorageError as error:
            self._fail(recording, error)
        finally:
            if black is not None:
                self._buffers.release(black)
        if pulse.time >= recording.commanded:
            self._note_latency(pulse, host_now())
        self._tell_overruns(tag, pulse)

    def _note_latency(self, pulse: ClosedPulse, now: HostNs) -> None:
        arrivals = [outcome.record.host_time for outcome in pulse.outcomes if outcome.record is not None]
        if arrivals:
            self._latency.add(now - max(arrivals))

    def _tell_overruns(self, tag: TripletTag, pulse: ClosedPulse) -> None:
        """Tell of pulses missed because a camera was busy: the remedy differs from that for pulses it did not see."""
        why = "overrun: the camera saw it but was still busy with the frame before"
        for camera, outcome in zip(tag.cameras, pulse.outcomes, strict=True):
            if outcome.overrun:
                text = f"pulse {tag.pulse}: {why}; shorten its exposure or lower trigger.rate_hz"
                self.happened(Event.now(Level.WARNING, camera.name, text))
