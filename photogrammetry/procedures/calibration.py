"""Calibration of the cameras (paper, step 1): free adjustment of a 3D frame of unknown targets, self-calibrating.

The paper makes the free network regular by weighted poses (D.2). This module takes inner constraints, which do not
influence the residuals. Distances and coordinate differences stay: a scale bar gives the scale.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from photogrammetry.adjustment.equations.unknowns import state_of
from photogrammetry.adjustment.gross_errors.blunders import describe
from photogrammetry.adjustment.run import Outcome, adjust, settled
from photogrammetry.adjustment.solution.adjustment import Adjustment
from photogrammetry.network.model import Datum, DatumType, Network, Point, Role
from photogrammetry.network.selection import RAYS, only_points, rays, require_unknown_poses
from photogrammetry.procedures.stages import refuse_absurd
from photogrammetry.start_values.search import complete
from rig.errors import BadInputError

_CORRELATION_MOST = 0.95  # correlation beyond which two interior parameters can hardly be told apart


@dataclass(frozen=True, slots=True, eq=False)
class Calibration:
    """Calibrated cameras.

    Attributes:
        outcome: the free adjustment.
        notes: changes that were made to the network, and doubtful parameters.
    """

    outcome: Outcome
    notes: tuple[str, ...]


def calibrate(network: Network) -> Calibration:
    """Estimate the interior orientations that the network's cameras ask for, all poses and all targets.

    Gross errors that can be located are taken out, the worst first.

    Args:
        network: images of a frame. Surveyed coordinates are used as start values only.

    Raises:
        BadInputError: no camera estimates anything, or a pose is constant.
        NotSolvableError, NotConvergedError: as the adjustment.
        RefusedError: the images contradict each other so much that no result can be believed.
    """
    free, notes = _free(network)
    outcome = settled(adjust(free, state_of(complete(free)), snoop=True))
    refuse_absurd(outcome, [describe(outcome.adjustment.network, blunder) for blunder in outcome.blunders])
    if outcome.adjustment.scale_is_free:
        notes.append(
            "no distance gives the scale: all lengths and their sigmas are in units of unknown size; measure a "
            "distance if the frame matters (the interior orientations do not depend on it)"
        )
    return Calibration(outcome, (*notes, *_doubts(outcome.adjustment)))


def _free(network: Network) -> tuple[Network, list[str]]:
    """The free network, and notes on the changes that make it one."""
    if not any(camera.estimate for camera in network.cameras):
        raise BadInputError(
            'no camera estimates anything; list its unknown parameters under "estimate", for instance ["c", "x0", "y0"]'
        )
    require_unknown_poses(network, "calibration")
    notes = []
    unused = [
        i
        for i, (point, count) in enumerate(zip(network.points, rays(network), strict=True))
        if point.role in (Role.CONTROL, Role.FIXED, Role.CHECK) and count < RAYS
    ]
    if unused:
        names = ", ".join(network.points[i].name for i in unused)
        notes.append(f"surveyed points that fewer than two images show are left out: {names}")
        stays = np.ones(len(network.points), dtype=bool)
        stays[unused] = False
        network = only_points(network, stays)
    surveyed = [point.name for point in network.points if point.role is not Role.TIE]
    if surveyed:
        notes.append(f"free network: the survey of {len(surveyed)} points is not used ({surveyed[0]} the first)")
    if any(image.sigma_position is not None or image.sigma_angles is not None for image in network.images):
        notes.append("free network: the sigmas of given poses are not used")
    points = network.datum.points if network.datum.type is DatumType.INNER else None
    free = replace(
        network,
        points=tuple(Point(point.name, Role.TIE, point.xyz) for point in network.points),
        images=tuple(replace(image, sigma_position=None, sigma_angles=None) for image in network.images),
        datum=Datum(DatumType.INNER, points),
    )
    return free, notes


def _doubts(a: Adjustment) -> Iterator[str]:
    """Parameters that the images hardly determine, in words."""
    for i, camera in enumerate(a.network.cameras):
        parameters, correlations = a.parameters(i)
        zero = [parameter.name for parameter in parameters if parameter.insignificant]
        if zero:
            yield f"camera {camera.name}: not significantly different from zero: {', '.join(zero)}"
        for (k, one), (j, other) in combinations(enumerate(camera.estimate), 2):
            if abs(correlations[j, k]) >= _CORRELATION_MOST:
                yield (
                    f"camera {camera.name}: {one} and {other} can hardly be told apart "
                    f"(correlation {correlations[j, k]:.3f}); add images rolled by 90 degrees, or drop one of them"
                )
