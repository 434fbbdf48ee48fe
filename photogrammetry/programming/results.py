"""An adjusted network by the names of its cameras, images and points, instead of by columns."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from photogrammetry.adjustment.gross_errors.blunders import describe
from photogrammetry.adjustment.run import Outcome
from photogrammetry.adjustment.solution.adjustment import Adjustment
from photogrammetry.adjustment.solution.global_test import GlobalTest
from photogrammetry.geometry.camera_model import INTERIOR
from photogrammetry.reports.result_file import outcome_to_json
from rig.arrays import Floats
from rig.errors import BadInputError


@dataclass(frozen=True, slots=True, eq=False)
class AdjustedCamera:
    """Interior orientation: adjusted values by name (c, x0, y0, ...), and a-posteriori sigmas of the estimated ones."""

    values: dict[str, float]
    sigmas: dict[str, float]


@dataclass(frozen=True, slots=True, eq=False)
class AdjustedImage:
    """A pose.

    Attributes:
        camera: name of its camera.
        X0: (3,) projection centre.
        R: (3, 3), its columns are the camera's axes.
        sigma: (3,) of X0, a posteriori; zeros for a constant pose.
        sigma_angles: (3,) rad, of turns about the camera's own axes.
    """

    camera: str
    X0: Floats
    R: Floats
    sigma: Floats
    sigma_angles: Floats


@dataclass(frozen=True, slots=True, eq=False)
class AdjustedPoint:
    """A point: coordinates xyz (3,), their a-posteriori sigma (3,) and covariance (3, 3); zeros for a fixed point."""

    xyz: Floats
    sigma: Floats
    covariance: Floats


class Result:
    """An adjusted network.

    Attributes:
        outcome: the adjustment with all that there is, by columns.
        notes: what the procedure changed or doubts, in words.
    """

    def __init__(self, outcome: Outcome, notes: Sequence[str] = ()) -> None:
        self.outcome = outcome
        self.notes = tuple(notes)

    @property
    def adjustment(self) -> Adjustment:
        """The adjustment by columns: covariance of any unknowns, residuals, test values."""
        return self.outcome.adjustment

    @property
    def sigma0(self) -> float | None:
        """Estimated sigma0 in the unit of the network's; None where nothing is redundant."""
        return self.adjustment.sigma0

    @property
    def redundancy(self) -> int:
        """Observations - unknowns + datum conditions."""
        return self.adjustment.redundancy

    @property
    def verdict(self) -> str:
        """Of the global test: "agrees", "smaller", "larger" or "absurd"."""
        return GlobalTest(self.adjustment.ratio, self.redundancy).verdict.value

    @property
    def length_unit(self) -> str:
        """Unit of all lengths; empty where no distance gives the scale."""
        return "" if self.adjustment.scale_is_free else self.adjustment.network.length_unit

    @property
    def gross_errors(self) -> tuple[str, ...]:
        """Suspected gross errors in words, the worst first."""
        return tuple(describe(one.network, one.blunder).text for one in self.outcome.suspected)

    @property
    def removed(self) -> tuple[str, ...]:
        """Observations that were taken out, in words."""
        return tuple(describe(one.network, one.blunder).text for one in self.outcome.removed)

    @cached_property
    def cameras(self) -> dict[str, AdjustedCamera]:
        """Cameras by name."""
        found = {}
        for i, camera in enumerate(self.adjustment.network.cameras):
            values = dict(zip(INTERIOR, self.adjustment.state.interior[i].tolist(), strict=True))
            parameters, _ = self.adjustment.parameters(i)
            found[camera.name] = AdjustedCamera(values, {one.name: one.sigma for one in parameters})
        return found

    @cached_property
    def images(self) -> dict[str, AdjustedImage]:
        """Images by name."""
        a = self.adjustment
        sigma = a.sigmas(a.problem.unknowns.pose)
        return {
            image.name: AdjustedImage(
                a.network.cameras[image.camera].name,
                a.state.position[i],
                a.state.rotation[i],
                sigma[i, :3],
                sigma[i, 3:],
            )
            for i, image in enumerate(a.network.images)
        }

    @cached_property
    def points(self) -> dict[str, AdjustedPoint]:
        """Points by name."""
        a = self.adjustment
        columns = a.problem.unknowns.point
        sigma, covariance = a.sigmas(columns), a.covariance(columns)
        return {
            point.name: AdjustedPoint(a.state.xyz[i], sigma[i], covariance[i])
            for i, point in enumerate(a.network.points)
        }

    def covariance(self, *points: str) -> Floats:
        """Joint a-posteriori covariance of k points, (3k, 3k): X, Y, Z of the first, of the second, and so on.

        Raises:
            BadInputError: no point has this name.
        """
        index = {point.name: i for i, point in enumerate(self.adjustment.network.points)}
        for name in points:
            if name not in index:
                raise BadInputError(f"no point is called {name!r}; name points of the network")
        rows = np.array([index[name] for name in points], dtype=np.intp)
        return self.adjustment.covariance(self.adjustment.problem.unknowns.point[rows].ravel())

    def to_json(self) -> dict[str, Any]:
        """The object of the result file (`svev-adjustment/1`)."""
        return outcome_to_json(self.outcome)
