"""The skis of a jumper who is followed: what the past predicts of them is fitted in the images of the next pulse."""

from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from analysis.identification.over_time.prediction import Prediction
from analysis.identification.ski_bars import Bindings, MeasuredSkis, SkiPair, measured, sought_from
from analysis.identification.ski_turns import SOUGHT_RAD, by_turns
from analysis.identification.space.views import gate
from analysis.ski_bars.bars import SKIS, Poses
from analysis.ski_bars.directions import directions, seek_directions
from analysis.ski_bars.fitting import FittedBars
from analysis.ski_bars.pixels import SkiView
from rig.arrays import Flags, Floats

#: A direction that is predicted better than this is fitted from there; otherwise it is sought in the last moments.
_PREDICTED_RAD: Final = np.radians(4.0)
_MOMENTS: Final = 5  #: pulses: in one alone a leg may be the better line
_RECENT: Final = 30  #: pulses that tell how long the skis are


class FollowedSkis:
    """The skis of one jumper; pulses come in order."""

    def __init__(self) -> None:
        self._pair = SkiPair()
        self._seen: deque[tuple[FittedBars, Bindings]] = deque(maxlen=_RECENT)
        self._moments: deque[tuple[float, Sequence[SkiView], Bindings, Flags]] = deque(maxlen=_MOMENTS)

    def measured(
        self, time_s: float, views: Sequence[SkiView], bindings: Bindings, angles: Prediction, axes: Floats
    ) -> MeasuredSkis:
        """What the images of the next pulse show of them.

        Args:
            time_s: of the pulse.
            views: its images.
            bindings: (2,) their places.
            angles: (1, 2, 2) slope and heading in the frame of the flight, predicted, rad.
            axes: (3, 3) of that frame.
        """
        known = sought_from(views, bindings)
        self._moments.append((time_s, views, bindings, known))
        if not known.any():
            return {}
        sure = np.linalg.eigvalsh(angles.covariance[0])[:, -1] < _PREDICTED_RAD**2
        slope, heading = angles.xyz[0].T
        direction = np.stack([directions(slope[k : k + 1], heading[k : k + 1], axes)[0, 0] for k in range(SKIS)])
        by_angles = np.linalg.inv(by_turns(Poses(bindings.xyz, direction), axes))
        turning = by_angles @ angles.covariance[0] @ by_angles.swapaxes(1, 2)
        if (unsure := known & ~sure).any():
            times, pulses, places, there = zip(*self._moments, strict=True)
            xyz, covariance = (np.array(part) for part in zip(*((at.xyz, at.covariance) for at in places), strict=True))
            sought = seek_directions(pulses, xyz, covariance, np.array(there), np.array(times), axes)
            direction[unsure], turning[unsure] = sought.direction[-1][unsure], np.diag(SOUGHT_RAD**2)
        fit = self._pair.fitted(views, bindings, direction, turning, known)
        turned = Poses(bindings.xyz, direction).step_to(fit.poses)[:, 3:]
        contradiction = (turned * np.linalg.solve(turning, turned[..., None])[..., 0]).sum(axis=1)
        seen = np.array(fit.seen) & (contradiction < gate(2))
        if len(self._moments) < _MOMENTS:
            seen &= sure  # what was sought in one or two pulses alone may be anything
        fit = replace(fit, seen=(bool(seen[0]), bool(seen[1])))  # what contradicts tells nothing of the shape either
        self._seen.append((fit, bindings))
        self._pair.learn(self._seen)
        return measured(fit, seen)
