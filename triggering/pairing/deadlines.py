"""How long a pulse waits for its frames, and for later pulses, whose frames tell why one of its own is missing."""

from collections.abc import Sequence
from typing import Final

from rig.clocks import NS_PER_S, HostNs
from triggering.pairing.camera.track import CameraTrack
from triggering.pairing.held import HeldFrames
from triggering.pairing.known_pulses import KnownPulses
from triggering.pairing.outcomes import OpenPulse
from triggering.pairing.silence import SILENT_PERIODS
from triggering.timeline.pulse_train import PulseTrain

#: Where the pulses have no rhythm, one that lacks a frame waits this long for later pulses, which tell why.
_PATIENCE_NS: Final = 30 * NS_PER_S
#: Pulses this much slower than the rig file says get more time, so that later ones can still tell of their frames.
_SLOWER: Final = 1.25


class Deadlines:
    """Deadlines of the open pulses.

    Args:
        hold_ns: how long after a pulse its frames may come, at the nominal period.
        period_ns: nominal period of the pulses.
        tracks: the cameras.
        pulses: the open pulses.
        held: the frames that wait.
        train: the rhythm of the pulses.

    Attributes:
        least_hold_ns: `hold_ns` as given.
    """

    def __init__(
        self,
        hold_ns: int,
        period_ns: int,
        tracks: Sequence[CameraTrack],
        pulses: KnownPulses,
        held: HeldFrames,
        train: PulseTrain,
    ) -> None:
        self.least_hold_ns, self._nominal_ns = hold_ns, period_ns
        self._tracks, self._pulses, self._held, self._train = tracks, pulses, held, train
        self._open_most = max(SILENT_PERIODS, hold_ns // period_ns)
        self._hurry_until = HostNs(0)

    def hurry(self, until: HostNs) -> None:
        """Let no pulse up to a time wait longer than the hold."""
        self._hurry_until = max(self._hurry_until, until)

    @property
    def hold_ns(self) -> int:
        """How long after a pulse its frames may come; longer where pulses are far slower than the rig file says."""
        times = self._train.period_ns / self._nominal_ns
        return round(self.least_hold_ns * times) if times > _SLOWER else self.least_hold_ns

    def of_first(self, pulse: OpenPulse) -> HostNs:
        """When the first open pulse is decided at the latest.

        Pulses in a rhythm are decided at the end of the hold: by then the frames of the next ones have come, whose ids
        tell why one is missing. A pulse from a hand waits for as many others as fire during the hold in a rhythm, if
        they do not keep it waiting too long; so there are never more open pulses than in a rhythm.
        """
        hold = HostNs(pulse.time + self.hold_ns)
        if self._held.count:
            hold = max(hold, self._held.last_end(pulse, hold))
        if pulse.time <= self._hurry_until or self._train.rhythm.usual_ns is not None:
            return hold
        lacking = (track for track, frame in zip(self._tracks, pulse.frames, strict=True) if frame is None)
        if not any(track.will_tell and track.may_deliver(pulse.time) for track in lacking):
            return hold
        patience = HostNs(pulse.time + _PATIENCE_NS)
        if len(self._pulses.open) <= self._open_most:
            return max(hold, patience)
        return max(hold, min(patience, self._pulses.open[self._open_most].time))
