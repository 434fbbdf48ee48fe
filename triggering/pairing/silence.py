"""Finds the cameras that deliver nothing while others do: suspects at once, decides at the deadline of a pulse."""

from collections.abc import Iterator, Sequence
from typing import Final

from rig.clocks import HostNs
from triggering.pairing.camera.activity import HELD_BACK_NS
from triggering.pairing.camera.presence import FIRST_NS
from triggering.pairing.camera.track import CameraTrack
from triggering.pairing.held import HeldFrames
from triggering.pairing.outcomes import OpenPulse
from triggering.timeline.pulse_train import PulseTrain

#: So many periods without a frame are a silence.
SILENT_PERIODS: Final = 3


class Silence:
    """Judges the cameras by the pulses that lack their frames.

    Args:
        tracks: the cameras.
        held: the frames that wait; a camera that has one is not silent.
        train: the rhythm of the pulses.
    """

    def __init__(self, tracks: Sequence[CameraTrack], held: HeldFrames, train: PulseTrain) -> None:
        self._tracks, self._held, self._train = tracks, held, train

    def overdue(self, waiting: Sequence[OpenPulse], now: HostNs, hold_ns: int) -> Iterator[int]:
        """The connected cameras that are three pulses behind the others at host time `now`.

        Frames that are on their way, or held back behind a damaged one, cause no suspicion.

        Args:
            waiting: the undecided pulses in the order of time.
            now: present host time.
            hold_ns: how long after a pulse its frames may come.
        """
        if len(waiting) < SILENT_PERIODS:
            return
        for camera, track in enumerate(self._tracks):
            alive = track.activity.alive
            since = alive if track.delivers else alive + FIRST_NS
            since = max(since, HostNs(now - hold_ns))
            behind = [pulse.time for pulse in waiting if pulse.frames[camera] is None and pulse.time > since]
            late = len(behind) >= SILENT_PERIODS and now > behind[0] + track.latency_ns + HELD_BACK_NS
            if late and track.connected and not track.is_slow(now) and not self._held.any_of(camera):
                yield camera

    def decide(self, pulse: OpenPulse, waiting: Sequence[OpenPulse], now: HostNs) -> None:
        """At the deadline of a pulse, find which of the cameras without a frame of it are silent."""
        for camera, track in enumerate(self._tracks):
            if pulse.frames[camera] is not None or self._held.any_of(camera):
                continue
            if not track.may_deliver(pulse.time) or track.activity.alive > pulse.time:
                continue
            if track.is_slow(now) or track.activity.heard > pulse.time + track.latency_ns + HELD_BACK_NS:
                continue  # its frames are still coming
            periods, before = track.activity.unanswered, pulse.time
            for other in waiting:
                # Frames of younger pulses may be on their way. Pulses that no camera delivered count too.
                if other.time - pulse.time < (SILENT_PERIODS - 0.5) * self._train.period_ns:
                    periods += 1 + self._train.room(other.time - before)
                    before = other.time
            if periods >= SILENT_PERIODS:
                track.fall_silent()
