"""The skis of a jumper who is followed: what the past predicts of them is fitted in the images of the next pulse."""

from collections import deque
from collections.abc import Sequence
from typing import Final

import numpy as np
from scipy.special import chdtri

from analysis.identification.over_time.prediction import Prediction
from analysis.identification.ski_bars import SOUGHT_RAD, Bindings, MeasuredSkis, SkiPair, measured, sought_from
from analysis.ski_bars.bars import OF_POSE, SKIS
from analysis.ski_bars.directions import directions, seek_directions
from analysis.ski_bars.fitting import FittedBars
from analysis.ski_bars.pixels import SkiView
from rig.arrays import Floats

#: A direction that is predicted better than this is fitted from there; otherwise it is sought.
_PREDICTED_RAD: Final = np.radians(4.0)
_RECENT: Final = 30  #: pulses that tell how long the skis are
_RISK: Final = 1e-4  #: probability of a sound pulse to contradict its prediction


class FollowedSkis:
    """The skis of one jumper; pulses come in order."""

    def __init__(self) -> None:
        self._pair = SkiPair()
        self._seen: deque[tuple[FittedBars, Floats]] = deque(maxlen=_RECENT)

    def measured(self, views: Sequence[SkiView], bindings: Bindings, angles: Prediction, axes: Floats) -> MeasuredSkis:
        """What the images of the next pulse show of them.

        Args:
            views: images of the pulse.
            bindings: (2,) their places.
            angles: (1, 2, 2) slope and heading in the frame of the flight, predicted, rad.
            axes: (3, 3) of that frame.
        """
        known = sought_from(views, bindings)
        if not known.any():
            return {}
        sure = np.linalg.eigvalsh(angles.covariance[0])[:, -1] < _PREDICTED_RAD**2
        slope, heading = angles.xyz[0].T
        direction = np.stack([directions(slope[k : k + 1], heading[k : k + 1], axes)[0, 0] for k in range(SKIS)])
        # a turn to the side is one of the heading times the cosine of the slope; to the left it counts backward
        by_angles = np.array([((0.0, -np.cos(s)), (1.0, 0.0)) for s in slope])
        turning = by_angles @ angles.covariance[0] @ by_angles.swapaxes(1, 2)
        if (unsure := known & ~sure).any():
            sought = seek_directions([views], bindings.xyz[None], unsure[None], np.zeros(1), axes)
            direction[unsure], turning[unsure] = sought.direction[0][unsure], SOUGHT_RAD**2 * np.eye(2)
        fit = self._pair.fitted(views, bindings, direction, turning, known)
        if fit.distance > chdtri(SKIS * OF_POSE, _RISK):
            return {}
        self._seen.append((fit, bindings.xyz))
        self._pair.learn(self._seen)
        return measured(fit, np.array(fit.seen))
