"""Judges whether the trigger time of a frame can be believed when the frame arrives.

A camera's clock may be set at any time: by PTP that locks, or by a restart that nobody reports. Until a reading of the
clock shows it, every frame would be placed wrongly, and one that is off by a whole period looks like a good one of the
next pulse. Frame numbers tell: a frame that comes one period after the last one, with the next number, shows that the
clock was not set in between. Any other frame is believed when its camera's clock has been read after it, and goes on
as it did.
"""

from typing import Final

from triggering.timeline.pulse_train import PulseTrain

#: A camera's first frames are believed: the rig warms up, and no rhythm is known by which they could be judged.
_FIRST: Final = 16
#: Weight of a frame in the longest time to the arrival, which otherwise fades.
_FADES: Final = 0.01


class Witness:
    """Judges the frames of one camera.

    Args:
        train: the rhythm of the pulses.

    Attributes:
        longest_ns: longest time of late from the trigger of a frame to its arrival.
    """

    def __init__(self, train: PulseTrain) -> None:
        self._train = train
        self._frames = 0
        self.longest_ns = 0.0

    def saw(self, latency_ns: int) -> None:
        """Enter the time from the trigger of a frame that was believed to its arrival."""
        self._frames += 1
        longer_ns = latency_ns - self.longest_ns
        self.longest_ns += longer_ns if longer_ns > 0 else _FADES * longer_ns

    def believes(self, span_ns: int | None, steps: int) -> bool:
        """Whether a frame is to be believed at once.

        Args:
            span_ns: time from the last frame that was believed to this one; None: there is none in this epoch.
            steps: how many frames the camera took in that time, by its numbers.
        """
        train = self._train
        if self._frames < _FIRST:
            return True
        if span_ns is None or steps <= 0 or not train.steady:
            return False
        return abs(span_ns - steps * train.period_ns) <= train.tolerance_ns
