"""Writes and publishes single pulses of a recording, and says how long they took and what cameras overran."""

from collections.abc import Iterator
from typing import Final

from recorder.live.health import LatencyHistogram
from recorder.live.preroll import Held, Preroll
from recorder.live.recording import Recording
from recorder.log.triplet_buffers import TripletBuffers
from recorder.publishing.publisher import Publisher
from rig.clocks import NS_PER_S, HostNs, host_now
from rig.events import Event, Level
from rig.phrase import phrase
from rig.tag import TripletTag
from triggering.pairing.pairer import ClosedPulse

#: How long after its start a recording waits for subscribers that take its pre-roll more slowly than the disk does.
_PATIENCE_NS: Final = 10 * NS_PER_S


class PulseWriter:
    """Hands pulses to a recording's log and to the subscribers.

    Args:
        buffers: hold the triplets.
        preroll: queue of the pulses that no recording has taken yet.
        publisher: publishes every recorded pulse.
        latency: counts how long pulses took that did not wait in the pre-roll.
    """

    def __init__(
        self, buffers: TripletBuffers, preroll: Preroll, publisher: Publisher, latency: LatencyHistogram
    ) -> None:
        self._buffers, self._preroll, self._publisher, self._latency = buffers, preroll, publisher, latency

    def lags(self, recording: Recording, held: Held, now: HostNs) -> bool:
        """Whether to pause the pre-roll, since subscribers would miss pulses that come faster than they take them."""
        if held.triplet.pulse.time >= recording.span.commanded or now > recording.span.commanded + _PATIENCE_NS:
            return False
        in_flight = self._buffers.count - self._preroll.triplets
        # No pause once half of the buffers for new frames are taken: subscribers may be slower than the cameras.
        return self._publisher.busy and self._buffers.free_count > in_flight // 2

    def write(self, recording: Recording, tag: TripletTag, held: Held) -> None:
        """Publish a pulse and hand it to the log.

        Raises:
            StorageError: the log does not take it; it is published nevertheless.
        """
        pulse, slot = held.triplet.pulse, held.triplet.slot
        # No frame came at all: a black triplet, unless no camera was there, which may last for hours.
        black = self._buffers.acquire() if slot is None and not pulse.unwatched else None
        if black is not None:
            self._buffers.write(black, 0)
            slot = black
        encoded = tag.encode()
        self._publisher.triplet(encoded, self._buffers, slot)
        try:
            recording.write(tag, held, slot, encoded)
        finally:
            if black is not None:
                self._buffers.release(black)
            if pulse.time >= recording.span.commanded:
                self.note_latency(pulse, host_now())

    def note_latency(self, pulse: ClosedPulse, now: HostNs) -> None:
        """Count the time since the last frame of a pulse came."""
        arrivals = [outcome.record.host_time for outcome in pulse.outcomes if outcome.record is not None]
        if arrivals:
            self._latency.add(now - max(arrivals))


def overruns(tag: TripletTag, pulse: ClosedPulse) -> Iterator[Event]:
    """Tell of pulses missed because a camera was busy: the remedy differs from that for pulses it did not see."""
    text = (
        "pulse {pulse}: overrun: the camera saw it but was still busy with the frame before; shorten its exposure or "
        "lower trigger.rate_hz"
    )
    for camera, outcome in zip(tag.cameras, pulse.outcomes, strict=True):
        if outcome.overrun:
            yield Event.now(Level.WARNING, camera.name, phrase("event_overrun", text, pulse=tag.pulse))
