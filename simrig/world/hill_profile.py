"""Longitudinal profile of the jumping hill around the take-off edge.

Frame of the whole simulated hill: origin at the take-off edge (middle of the table, surface of the tracks), X
horizontal along the flight, Z up, Y to the left, which completes a right-handed system. Unit m.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from simrig.world.scenario import Hill


@dataclass(frozen=True, slots=True)
class HillProfile:
    """Take-off table and knoll of one hill.

    The table is straight. The knoll is the cubic of the FIS standards for the construction of jumping hills: it begins
    below the edge with its own slope and reaches the P point, where the landing slope is steepest, in height and slope.
    """

    hill: Hill

    def table(self, x: ArrayLike) -> NDArray[np.float64]:
        """Height of the table's surface above the edge, for x <= 0."""
        return np.asarray(x, float) * -math.tan(math.radians(self.hill.table_angle_deg))

    def ground(self, x: ArrayLike) -> NDArray[np.float64]:
        """Height of the snow of knoll and landing slope; level under the table, straight beyond the P point."""
        hill, x = self.hill, np.asarray(x, float)
        foot, steep = math.tan(math.radians(hill.knoll_angle_deg)), math.tan(math.radians(hill.p_angle_deg))
        u = -hill.p_z_m - hill.table_height_m - hill.p_x_m * foot
        v = hill.p_x_m * (steep - foot)
        part = np.clip(x, 0.0, hill.p_x_m) / hill.p_x_m
        knoll = -hill.table_height_m - foot * hill.p_x_m * part - (3 * u - v) * part**2 + (2 * u - v) * part**3
        beyond = np.maximum(x - hill.p_x_m, 0.0)
        height: NDArray[np.float64] = knoll - steep * beyond
        return height

    def snow(self, x: float, y: float) -> float:
        """Height of the snow anywhere: beside the knoll it rises to the left and falls gently to the right."""
        beside = max(0.0, abs(y) - self.hill.knoll_width_m / 2)
        return float(self.ground(x)) + (0.12 if y > 0 else -0.05) * beside
