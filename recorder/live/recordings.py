"""Starts and ends recordings, one at a time, and writes into them the pulses that belong to them.

A recording that begins in the past finds hundreds of pulses in the pre-roll. They are written in slices, and between
two slices the recorder reads the frames that keep coming. A recording is closed only when the disk has taken what was
written. So the recorder's loop never stands still for long.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final

from recorder.live.assembler import Assembler, Triplet
from recorder.live.health import LatencyHistogram
from recorder.live.preroll import Held, Preroll
from recorder.live.recording import Recording
from recorder.publishing.publisher import Publisher
from rig.clocks import NS_PER_S, HostNs, host_now
from rig.errors import BadInputError, StorageError
from rig.events import Event, Level
from rig.health import WritingHealth
from rig.tag import TripletTag
from rig.transport.messages import (
    RecorderFailed,
    RecorderReport,
    RecordingFinished,
    RecordingProgress,
    RecordingStarted,
    StartRecording,
)
from triggering.pairing.pairer import ClosedPulse

_SLICE_NS: Final = NS_PER_S // 200
#: How long after its start a recording waits for subscribers that take its pre-roll more slowly than the disk does.
_PATIENCE_NS: Final = 10 * NS_PER_S
#: How long a finished recording waits for a disk that does not take what was written.
_FLUSH_NS: Final = 30 * NS_PER_S

#: Sends a report to the parent process.
Report = Callable[[RecorderReport], None]


class Recordings:
    """Takes every decided pulse; writes and publishes those that belong to a recording.

    Args:
        assembler: makes the triplets.
        preroll: queue of the pulses that no recording has taken yet.
        publisher: publishes every recorded pulse, every event and every health record.
        latency: counts how long pulses took that did not wait in the pre-roll.
        report: sends a report to the service process.
    """

    def __init__(
        self, assembler: Assembler, preroll: Preroll, publisher: Publisher, latency: LatencyHistogram, report: Report
    ) -> None:
        self._assembler, self._buffers, self._preroll = assembler, assembler.buffers, preroll
        self._publisher, self._latency, self._report = publisher, latency, report
        self._recording: Recording | None = None
        # Since when the recording has all its pulses and waits for the disk.
        self._over_since: HostNs | None = None
        self._behind = False

    @property
    def running(self) -> bool:
        """Whether a recording is running or being closed."""
        return self._recording is not None

    @property
    def pressing(self) -> bool:
        """Whether `work` has something to do at once, even if no new pulse comes."""
        return self._behind or self._ending

    def statistics(self) -> WritingHealth | None:
        """Figures on the writing of the log; None without a recording."""
        return None if self._recording is None else self._recording.log.statistics()

    def start(self, order: StartRecording) -> None:
        """Begin a recording.

        Raises:
            BadInputError: a recording is running already, or the file cannot be made.
            StorageError: the disk refuses.
        """
        if self._recording is not None:
            raise BadInputError("a recording is running: stop it before starting another")
        recording = self._recording = Recording(order, self._assembler)
        held = [held.triplet.pulse.time for held in self._preroll if held.triplet.pulse.time >= recording.begin]
        first = recording.utc(held[0]) if held else None
        self._report(RecordingStarted(first_pulse=first))
        with self._guarded():
            for time, note in self._preroll.take_notes(since=recording.begin):
                if isinstance(note, Event):
                    recording.event(note)
                else:
                    recording.health(note, time)
        self.happened(Event.now(Level.INFO, "recorder", f"recording {order.recording} started"))

    def stop(self) -> None:
        """End the recording, if there is one, with the pulses that have fired until now."""
        if self._recording is not None:
            self._recording.stop()

    def take(self, triplet: Triplet) -> None:
        """Take a decided pulse, the latest so far, into the pre-roll."""
        ready = host_now()
        if self._recording is None or self._ending:
            self._note_latency(triplet.pulse, ready)
        self._preroll.add(triplet, ready)

    def work(self, now: HostNs) -> None:
        """Write pulses for some milliseconds at most; end the recording when it has all its pulses."""
        self._write_slice(until=HostNs(now + _SLICE_NS))
        recording = self._recording
        if recording is None or self._ending:
            self._preroll.trim(now)
        if recording is None:
            return
        if not self._ending and not self._behind and recording.finished(now):
            self._over_since = now
        if self._over_since is not None:
            flushed = recording.log.statistics().queued == 0
            if flushed or now > self._over_since + _FLUSH_NS:
                self._finish()

    def progress(self) -> None:
        """Report how far the recording is."""
        if self._recording is not None:
            ledger = self._recording.ledger
            self._report(RecordingProgress(counts=ledger.counts(), first_pulse=ledger.first_time))

    def happened(self, event: Event) -> None:
        """Publish an event and write it into the recording; without one, keep it for a recording with pre-roll."""
        self._publisher.event(event)
        if self._recording is None:
            self._preroll.note(host_now(), event)
        else:
            with self._guarded():
                self._recording.event(event)

    def health(self, health: bytes) -> None:
        """Publish and write or keep an encoded health record likewise; end the recording if the disk is nearly full."""
        self._publisher.health(health)
        now = host_now()
        if self._recording is None or self._ending:
            self._preroll.note(now, health)
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
        """Move pulses from the pre-roll into the recording until the time `until`; None: all of them."""
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
        """Whether to pause the pre-roll, since subscribers would miss pulses that come faster than they take them."""
        if held.triplet.pulse.time >= recording.commanded or now > recording.commanded + _PATIENCE_NS:
            return False
        in_flight = self._buffers.count - self._preroll.triplets
        # No pause once half of the buffers for new frames are taken: subscribers may be slower than the cameras.
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
        """Tell of pulses missed because a camera was busy: the remedy differs from that for pulses it did not see."""
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
            self._report(RecorderFailed.of(error))
            return
        self._report(
            RecordingFinished(
                path=recording.path,
                bytes=summary.bytes,
                unpublished=self._publisher.dropped,
                counts=recording.ledger.counts(),
                first_pulse=recording.ledger.first_time,
            )
        )

    @contextmanager
    def _guarded(self) -> Iterator[None]:
        """If writing fails within, end the recording, keep what its log holds, tell subscribers and the service."""
        try:
            yield
        except StorageError as error:
            recording, self._recording, self._over_since = self._recording, None, None
            if recording is not None:
                recording.log.abandon()
            self._publisher.event(Event.now(Level.FATAL, "recorder", str(error)))
            self._report(RecorderFailed.of(error))

    def _keep_reserve(self) -> None:
        """End the recording while there is still room to close its log."""
        recording, reserve = self._recording, self._assembler.rig.recorder.reserve_gb
        free = None if recording is None else recording.log.free_bytes()
        if recording is None or free is None or free >= reserve * 1e9:
            return
        why = f"only {free / 1e9:.1f} GB are free and {reserve:g} GB are kept in reserve: recording stopped; make room"
        self.happened(Event.now(Level.ERROR, "recorder", why))
        with self._guarded():
            recording.close()
            raise StorageError(f"{recording.path}: {why}; the log is whole up to there")
