"""The recordings of a running recorder, one at a time: pulses come in all the time, some of them go into a log.

A recording that begins in the past finds hundreds of pulses waiting. They are written in slices, between which the
frames that keep coming are taken in; and a recording is closed only when the disk has taken what was written, so that
nothing ever stands still for long.
"""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Final, Protocol

from recorder.assembler import Assembler, Triplet
from recorder.events import Event, Level
from recorder.latency import LatencyHistogram
from recorder.preroll import Held, Preroll, RecentNotes
from recorder.publisher import Publisher
from recorder.recording import Recording, RecordingOrder
from recorder.triplet_buffers import TripletBuffers
from rig.clocks import NS_PER_S, HostNs, host_now
from rig.errors import BadInputError, StorageError
from rig.settings import RigSettings
from rig.tag import TripletTag
from triggering.pairing import ClosedPulse

_SLICE_NS: Final = NS_PER_S // 200
#: So long after its start a recording waits for subscribers that take its past more slowly than the disk does.
_PATIENCE_NS: Final = 10 * NS_PER_S
#: So long a recording waits to be closed for a disk that does not take what was written.
_FLUSH_NS: Final = 30 * NS_PER_S


class Report(Protocol):
    """Tells the service process something."""

    def __call__(self, report: str, **content: Any) -> None:
        """Send a report of this name."""
        ...


class Recordings:
    """Pulses in, recordings out.

    Args:
        rig: the rig.
        assembler: makes the pulses.
        buffers: where their pixels are.
        publisher: gets every pulse that is recorded, and every event.
        preroll: where pulses wait.
        latency: is told how long those took that did not wait.
        report: tells the service process.
    """

    def __init__(
        self,
        rig: RigSettings,
        assembler: Assembler,
        buffers: TripletBuffers,
        publisher: Publisher,
        preroll: Preroll,
        latency: LatencyHistogram,
        report: Report,
    ) -> None:
        self._rig, self._assembler, self._buffers = rig, assembler, buffers
        self._publisher, self._preroll, self._latency, self._report = publisher, preroll, latency, report
        self._notes = RecentNotes(preroll.seconds)
        self._recording: Recording | None = None
        # It has all its pulses since then, and waits for the disk.
        self._over_since: HostNs | None = None
        self._behind = False

    @property
    def running(self) -> bool:
        """Whether a recording is running or being closed."""
        return self._recording is not None

    @property
    def pressing(self) -> bool:
        """Whether `work` has something to do at once, though nothing new comes."""
        return self._behind or self._ending

    def statistics(self) -> dict[str, Any] | None:
        """How writing goes, None without a recording."""
        return None if self._recording is None else self._recording.log.statistics()

    def start(self, order: RecordingOrder) -> None:
        """Begin a recording.

        Raises:
            BadInputError: one is running, or the file cannot be made.
            StorageError: the disk refuses.
        """
        if self._recording is not None:
            raise BadInputError("a recording is running: stop it before starting another")
        recording = Recording(order, self._rig, self._assembler, self._buffers)
        self._recording = recording
        held = [held.triplet.pulse.time for held in self._preroll if held.triplet.pulse.time >= recording.begin]
        first = recording.utc(held[0]) if held else None
        self._report("started", path=str(order.path), first_pulse_ns=first, preroll_pulses=len(held))
        with self._guarded():
            for time, note in self._notes.take(since=recording.begin):
                if isinstance(note, Event):
                    recording.event(note)
                else:
                    recording.health(note, time)
        self.happened(Event.now(Level.INFO, "recorder", f"recording {order.recording} started"))

    def stop(self) -> None:
        """Let the recording end with the pulses that have fired until now; without one nothing happens."""
        if self._recording is not None:
            self._recording.stop()

    def take(self, triplet: Triplet) -> None:
        """Take over a decided pulse, the latest so far."""
        ready = host_now()
        if self._recording is None or self._ending:
            self._note_latency(triplet.pulse, ready)
        self._preroll.add(triplet, ready)

    def work(self, now: HostNs) -> None:
        """Write what is due, for some milliseconds at most; end the recording when it has all its pulses."""
        self._write_slice(until=HostNs(now + _SLICE_NS))
        recording = self._recording
        if recording is None or self._ending:
            self._preroll.trim(now)
        if recording is None:
            return
        if not self._ending and not self._behind and recording.finished(now):
            self._over_since = now
        if self._over_since is not None:
            flushed = recording.log.statistics()["queued"] == 0
            if flushed or now > self._over_since + _FLUSH_NS:
                self._finish()

    def progress(self) -> None:
        """Report how far the recording is."""
        if self._recording is not None:
            self._report("progress", **self._counts(self._recording))

    def happened(self, event: Event) -> None:
        """Publish an event, and write it into the recording; without one keep it for one that begins before it."""
        self._publisher.event(event.to_json())
        if self._recording is None:
            self._notes.add(host_now(), event)
        else:
            with self._guarded():
                self._recording.event(event)

    def health(self, health: Mapping[str, Any]) -> None:
        """Write or keep a health record likewise; end the recording if the disk is nearly full."""
        now = host_now()
        if self._recording is None or self._ending:
            self._notes.add(now, health)
            return
        with self._guarded():
            self._recording.health(health, now)
        self._keep_reserve()

    def wind_up(self, why: str) -> None:
        """End a running recording now, with all pulses that are decided."""
        if self._recording is None:
            return
        if not self._ending:
            self.happened(Event.now(Level.ERROR, "recorder", f"recording ends early: {why}"))
            self._write_slice(until=None)
        self._finish()

    @property
    def _ending(self) -> bool:
        return self._over_since is not None

    def _write_slice(self, until: HostNs | None) -> None:
        """Move pulses from the queue into the recording."""
        recording, self._behind = self._recording, False
        while recording is not None and self._recording is recording and not self._ending:
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
        """Whether the past comes faster than subscribers take it: what they cannot take they would miss."""
        if held.triplet.pulse.time >= recording.commanded or now > recording.commanded + _PATIENCE_NS:
            return False
        in_flight = self._buffers.count - self._preroll.triplets
        # Subscribers that are slower than the cameras get no more time: the memory is for the frames that come.
        return self._publisher.busy and self._buffers.free_count > in_flight // 2

    def _write(self, recording: Recording, held: Held) -> None:
        pulse, slot = held.triplet.pulse, held.triplet.slot
        if slot is None and (slot := self._buffers.acquire()) is not None:
            self._buffers.pixels(slot).fill(0)  # no frame came at all: a black triplet
        tag = recording.tag(pulse)
        encoded = tag.encode()
        self._publisher.triplet(encoded, self._buffers, slot)
        with self._guarded():
            recording.write(tag, slot, encoded, held.ready)
        if pulse.time >= recording.commanded:
            self._note_latency(pulse, host_now())
        self._tell_overruns(tag, pulse)

    def _note_latency(self, pulse: ClosedPulse, now: HostNs) -> None:
        arrivals = [outcome.record.host_time for outcome in pulse.outcomes if outcome.record is not None]
        if arrivals:
            self._latency.add(now - max(arrivals))

    def _tell_overruns(self, tag: TripletTag, pulse: ClosedPulse) -> None:
        """A pulse missed because the camera was busy has another remedy than one that it did not see."""
        why = "overrun: the camera saw it but was still busy with the frame before"
        for camera, outcome in zip(tag.cameras, pulse.outcomes, strict=True):
            if outcome.overrun:
                text = f"pulse {tag.pulse}: {why}; shorten its exposure or lower trigger.rate_hz"
                self.happened(Event.now(Level.WARNING, camera.name, text))

    def _finish(self) -> None:
        recording, self._recording, self._over_since = self._recording, None, None
        if recording is None:
            return
        try:
            summary = recording.close()
        except StorageError as error:
            recording.log.abandon()
            self._report("failed", kind=type(error).__name__, message=str(error))
            return
        self._report(
            "finished", path=str(recording.path), bytes=summary.bytes, unpublished=self._publisher.dropped,
            **self._counts(recording),
        )  # fmt: skip

    @contextmanager
    def _guarded(self) -> Iterator[None]:
        """What is written within may fail: then the recording ends, keeps what it holds, and everybody is told."""
        try:
            yield
        except StorageError as error:
            recording, self._recording, self._over_since = self._recording, None, None
            if recording is not None:
                recording.log.abandon()
            self._publisher.event(Event.now(Level.FATAL, "recorder", str(error)).to_json())
            self._report("failed", kind=type(error).__name__, message=str(error))

    def _keep_reserve(self) -> None:
        """End the recording, whole, while there is still room to close it."""
        recording, reserve = self._recording, self._rig.recorder.reserve_gb
        if recording is None or (free := recording.log.free_bytes()) >= reserve * 1e9:
            return
        why = f"only {free / 1e9:.1f} GB are free and {reserve:g} GB are kept in reserve: recording stopped; make room"
        self.happened(Event.now(Level.ERROR, "recorder", why))
        with self._guarded():
            recording.close()
            raise StorageError(f"{recording.path}: {why}; the log is whole up to there")

    @staticmethod
    def _counts(recording: Recording) -> dict[str, Any]:
        return {**recording.ledger.counts(), "first_pulse_ns": recording.ledger.first_time}
