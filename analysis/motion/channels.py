"""What describes the jumper at one instant: sixteen channels, and how points and skis follow from them.

The channels are O, the three vectors hip - O, helmet - hip and left - right binding, and of the skis the mean and the
difference of slope and of heading. They live in the frame of the motion: Z up, X along the horizontal flight, so that
no survey frame is preferred and headings stay near zero.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from photogrammetry.jumper.stick_model import direction_of
from rig.arrays import Floats

#: Number of channels: 3 of O, 3 of each of three vectors, 4 of the skis.
CHANNELS: Final = 16
VECTORS: Final = 12  #: the first channels are metres
ORIGIN: Final = slice(0, 3)  #: O
SLOPE, SLOPE_DIFFERENCE, HEADING, OPENING = range(12, 16)

#: P1..P4 (rows) from O, hip - O, helmet - hip, left - right binding (columns).
POINT_WEIGHTS: Final = np.array(((1, 1, 1, 0), (1, 1, 0, 0), (1, 0, 0, -0.5), (1, 0, 0, 0.5)))
#: Slope and heading of the right and the left ski from the last four channels; opening is left minus right.
_SKI_WEIGHTS: Final = np.array((((1, 0.5, 0, 0), (0, 0, 1, -0.5)), ((1, -0.5, 0, 0), (0, 0, 1, 0.5))))

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

    def point_jacobian(self) -> Floats:
        """Derivatives of P1..P4 (4, 3, 16) by the channels."""
        by = np.zeros((4, 3, CHANNELS))
        for vector in range(4):
            by[:, :, 3 * vector : 3 * vector + 3] = POINT_WEIGHTS[:, vector, None, None] * self.rotation
        return by

    def skis(self, channels: Floats) -> Floats:
        """Unit directions of the right and the left ski in the object system (..., 2, 3)."""
        return direction_of(slopes_and_headings(channels)) @ self.rotation.T

    def ski_jacobian(self, channels: Floats) -> Floats:
        """Derivatives of the directions (..., 2, 3, 16) by the channels."""
        slope, heading = np.moveaxis(slopes_and_headings(channels), -1, 0)
        zero = np.zeros_like(slope)
        by_slope = np.stack((-np.sin(slope) * np.cos(heading), -np.sin(slope) * np.sin(heading), np.cos(slope)), -1)
        by_heading = np.stack((-np.cos(slope) * np.sin(heading), np.cos(slope) * np.cos(heading), zero), -1)
        local = np.stack((by_slope, by_heading), axis=-1)
        by = np.zeros((*local.shape[:-1], CHANNELS))
        by[..., VECTORS:] = np.einsum("ij,...sja,sak->...sik", self.rotation, local, _SKI_WEIGHTS)
        return by

    @property
    def heading(self) -> float:
        """Of the frame's X axis, rad, from X towards Y."""
        return float(np.arctan2(self.rotation[1, 0], self.rotation[0, 0]))


def slopes_and_headings(channels: Floats) -> Floats:
    """Slope and heading (in the frame of the motion) of the right and the left ski (..., 2, 2), rad."""
    return np.asarray(np.einsum("sak,...k->...sa", _SKI_WEIGHTS, channels[..., VECTORS:]))


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
