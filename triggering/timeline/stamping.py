"""Finds out which end of the exposure a camera notes as the time of a frame.

Most cameras note the beginning, some the end. The difference to the other cameras is learned where it is short. A
difference longer than the pairing allows for would make frames of neighbouring pulses look as if they were of one. But
then arrivals decide: no frame is in memory before its exposure has ended, so a frame that seems to be has not noted the
beginning. The first frames are not used, since a late arrival is no evidence.
"""

from typing import Final

from rig.clocks import HostNs
from triggering.timeline.pulse_train import PulseTrain

#: A single odd time proves nothing; so many frames do, if the next reading of the clock agrees with those before.
_FRAMES: Final = 3
#: So many frames are looked at before any is used.
_FIRST: Final = 7
#: Host times of clock readings and frames are noted this exactly.
_NOTED_NS: Final = 500_000


class Stamping:
    """Which end of the exposure one camera notes.

    Args:
        train: the rhythm of the pulses.
        exposure_ns: exposure of the camera; 0: its times are known to be those of the beginning.

    Attributes:
        late_ns: how long after the beginning of the exposure the camera notes the time; 0 until it is found out.
    """

    def __init__(self, train: PulseTrain, exposure_ns: int) -> None:
        self._train, self._exposure_ns = train, exposure_ns
        self.late_ns = 0
        self._early = self._seen = 0

    def contradicts(self, time: HostNs, arrival: HostNs, uncertainty_ns: float) -> bool:
        """Whether a frame came too early to be exposed from `time` on, or is one of the first: it is not to be used.

        Args:
            time: what the camera noted, on the common time line.
            arrival: when the frame was in memory.
            uncertainty_ns: largest error of `time`.
        """
        if self.late_ns or self._exposure_ns <= self._train.widest_ns:
            return False
        early = arrival + uncertainty_ns + _NOTED_NS < time + self._exposure_ns
        self._early += early
        self._seen += 1
        return early or self._seen <= _FIRST

    def confirmed(self, *, agrees: bool) -> bool:
        """Whether it is clear from now on that the camera notes the end.

        Args:
            agrees: whether a reading of the clock has just confirmed the times of the frames before it.
        """
        if not agrees:
            self._early = 0
        elif self._early >= _FRAMES:
            self._early, self.late_ns = 0, self._exposure_ns
            return True
        return False
