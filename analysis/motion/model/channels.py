"""What describes the jumper at one instant: sixteen channels, and how points and skis follow from them.

The channels are O, the three vectors hip - O, helmet - hip and left - right binding, and of the skis the mean and the
difference of slope and of heading. They live in the frame of the motion: Z up, X along the horizontal flight, so that
no survey frame is preferred and headings stay near zero.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from photogrammetry.jumper.stick_model import direction_of
from rig.arrays import Floats, Integers

#: Number of channels: 3 of O, 3 of each of three vectors, 4 of the skis.
CHANNELS: Final = 16
VECTORS: Final = 12  #: the first channels are metres
ORIGIN: Final = slice(0, 3)  #: O
SLOPE, SLOPE_DIFFERENCE, HEADING, OPENING = range(12, 16)

#: P1..P4 (rows) from O, hip - O, helmet - hip, left - right binding (columns).
POINT_WEIGHTS: Final = np.array(((1, 1, 1, 0), (1, 1, 0, 0), (1, 0, 0, -0.5), (1, 0, 0, 0.5)))
#: (2, 2, 4) slope and heading of the right and the left ski from the last four channels; opening is left minus right.
SKI_WEIGHTS: Final = np.array((((1, 0.5, 0, 0), (0, 0, 1, -0.5)), ((1, -0.5, 0, 0), (0, 0, 1, 0.5))))

#: Where a body part may be at all, m, m/s, rad: mean and standard deviation of value, speed and acceleration of each
#: channel in the first pulse. They are wide and matter only where nothing was measured.
START_MEAN: Final = np.array((0, 0, 0, 0, 0, 0.8, 0.3, 0, 0.5, 0, 0.3, 0, 0, 0, 0, 0), float)
START_SIGMA: Final = np.array(
    (
        [100.0] * 3 + [1.0] * 9 + [1.0] * 4,
        [50.0, 5.0, 20.0] + [5.0] * 9 + [10.0] * 4,  # the frame's X is along the motion
        [10.0, 5.0, 10.0] + [50.0] * 9 + [100.0] * 4,  # g, and half of it across
    )
)


@dataclass(frozen=True, slots=True, eq=False)
class MotionFrame:
    """The frame of the motion in the object system.

    Attributes:
        origin: (3,) m.
        rotation: (3, 3) about Z; its columns are the axes of the frame.
    """

    origin: Floats
    rotation: Floats

    def points(self, channels: Floats) -> Floats:
        """P1..P4 in the object system (..., 4, 3) from channels (..., 16)."""
        vectors = channels[..., :VECTORS].reshape(*channels.shape[:-1], 4, 3)
        return np.asarray(self.origin + np.einsum("lv,...vc->...lc", POINT_WEIGHTS, vectors) @ self.rotation.T)

    def by_vectors(self, by_points: Floats, labels: Integers) -> Floats:
        """Derivatives (..., g, q, 12) by the first channels, from those (..., g, q, 3) by one point each.

        Args:
            by_points: derivatives by points in the object system.
            labels: (g,) which of P1..P4 they are.
        """
        local = by_points @ self.rotation
        by = POINT_WEIGHTS[labels][:, None, :, None] * local[..., None, :]
        return np.asarray(by.reshape(*local.shape[:-1], VECTORS))

    def skis(self, channels: Floats) -> Floats:
        """Unit directions of the right and the left ski in the object system (..., 2, 3)."""
        return direction_of(slopes_and_headings(channels)) @ self.rotation.T

    def by_skis(self, channels: Floats) -> Floats:
        """Derivatives of the directions of the skis (..., 2, 3, 4) by the last four channels."""
        slope, heading = np.moveaxis(slopes_and_headings(channels), -1, 0)
        level, up = np.cos(slope), np.sin(slope)
        ahead, aside = np.cos(heading), np.sin(heading)
        local = np.zeros((*slope.shape, 3, 2))
        local[..., 0, 0], local[..., 1, 0], local[..., 2, 0] = -up * ahead, -up * aside, level
        local[..., 0, 1], local[..., 1, 1] = -level * aside, level * ahead
        return np.asarray(self.rotation @ local @ SKI_WEIGHTS)

    @property
    def heading(self) -> float:
        """Of the frame's X axis, rad, from X towards Y."""
        return float(np.arctan2(self.rotation[1, 0], self.rotation[0, 0]))


def slopes_and_headings(channels: Floats) -> Floats:
    """Slope and heading (in the frame of the motion) of the right and the left ski (..., 2, 2), rad."""
    return np.asarray(np.einsum("sak,...k->...sa", SKI_WEIGHTS, channels[..., VECTORS:]))


def ski_channels(right: Floats, left: Floats) -> Floats:
    """The last four channels (..., 4) from slope and heading (..., 2) of both skis."""
    return np.stack(
        (
            (right[..., 0] + left[..., 0]) / 2,
            right[..., 0] - left[..., 0],
            (right[..., 1] + left[..., 1]) / 2,
            left[..., 1] - right[..., 1],
        ),
        axis=-1,
    )
