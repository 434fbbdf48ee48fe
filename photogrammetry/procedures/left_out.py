"""What an adjustment that fails can do without: images that nothing orients, tie points that their rays do not place.

One tie point with parallel or diverging rays has no optimum, and would take that of all others away. One that is
another object in each image contradicts what is sound. So where an adjustment fails, it is tried without these, and
they are named.
"""

from collections.abc import Collection, Iterator
from typing import Final

import numpy as np

from photogrammetry.adjustment.equations.unknowns import State
from photogrammetry.adjustment.solution.global_test import ABSURD
from photogrammetry.geometry.ideal_camera import IdealCamera
from photogrammetry.intersection.point_intersection import PointState, intersect_points
from photogrammetry.network.diagnosis import DefectKind, NotConvergedError, NotSolvableError, RefusedError
from photogrammetry.network.model import Network
from photogrammetry.network.selection import only_points, rays, sub_network, with_interior
from photogrammetry.procedures.findings import SURVEYED
from photogrammetry.start_values.sightings import reduce_observations
from rig.arrays import Flags, Floats
from rig.phrase import Phrase, phrase

#: Errors of an adjustment.
Failure = NotSolvableError | NotConvergedError | RefusedError
#: Rays from start values are so much less accurate than their image points.
START_CAUTION: Final = 30.0
#: Part of the tie points that may be other objects in each image; of more the cause is not single points.
_MOST_WRONG: Final = 3
_CONTRADICTED: Final = (PointState.OK, PointState.BEHIND, PointState.NOT_CONVERGED)


def without_points(network: Network, gone: Collection[str]) -> Network:
    """The network without the points of some names; the same network if there are none."""
    if not gone:
        return network
    return only_points(network, np.array([point.name not in gone for point in network.points], dtype=bool))


def unplaced_points(network: Network, state: State, caution: float = 1.0) -> dict[str, str]:
    """Names of the points without survey that their rays do not place, and why.

    Args:
        network: the network.
        state: its poses, and interior orientations.
        caution: rays count as so many times less accurate than their image points: the poses are only start values.

    Returns:
        Where many tie points contradict their rays, only those without a contradiction: the poses are wrong then.
    """
    found = list(_unplaced(network, state, caution))
    ties = sum(point.role not in SURVEYED for point in network.points)
    believed = sum(how in _CONTRADICTED for _, how, _ in found) <= max(1, ties // _MOST_WRONG)
    return {name: words for name, how, words in found if believed or how not in _CONTRADICTED}


def naming_unplaced(error: NotConvergedError, network: Network, start: State) -> NotConvergedError:
    """The error with the tie points that their rays do not place at the start values, if there are any."""
    found = unplaced_points(network, start, START_CAUTION)
    if not found:
        return error
    words = "; ".join(f"{name} {why}" for name, why in found.items())
    text = "{error}; tie points without a place, leave them out: {words}"
    return NotConvergedError(phrase("unconverged_ties", text, error=error.said, words=words))


def _unplaced(network: Network, state: State, caution: float) -> Iterator[tuple[str, PointState, str]]:
    ties = np.array([i for i, point in enumerate(network.points) if point.role not in SURVEYED], dtype=np.intp)
    if not len(ties) or not network.images:
        return
    sightings = reduce_observations(with_interior(network, state.interior))
    images = list(range(len(network.images)))
    xy, seen, sigma = sightings.table(images, ties)
    cameras = [IdealCamera(sightings.c_of(i), state.position[i], state.rotation[i]) for i in images]
    meeting = intersect_points(cameras, xy, seen=seen, sigma=sigma * caution)
    apart = _apart(meeting.residuals, sigma * caution, seen)
    for place, index in enumerate(ties):
        how = PointState(int(meeting.state[place]))
        if how is PointState.OK and not apart[place] > ABSURD:
            continue
        shown = ", ".join(network.images[i].name for i in np.flatnonzero(seen[place])) or "no image"
        reason = how.words if how is not PointState.OK else "its rays miss each other: check the correspondence"
        yield network.points[index].name, how, f"in {shown}, {reason}"


def _apart(residuals: Floats, sigma: Floats, seen: Flags) -> Floats:
    """(n,) root mean square of the residuals of each point in their sigmas, over its redundancy; 0 without any."""
    squares = np.where(seen, np.nan_to_num((residuals**2).sum(axis=2)) / sigma**2, 0.0).sum(axis=1)
    return np.asarray(np.sqrt(squares / np.maximum(2 * seen.sum(axis=1) - 3, 1)))


def without_images(network: Network, failure: Failure) -> tuple[Network, list[Phrase]] | None:
    """The network without the images that nothing orients.

    Args:
        network: whose adjustment failed.
        failure: why.

    Returns:
        The network without them and without the tie points that they alone show, and a line for each reason; None if
        the failure is not that of an image, or none is left.
    """
    if not isinstance(failure, NotSolvableError):
        return None
    defects = [defect for defect in failure.defects if defect.kind is DefectKind.IMAGES]
    names = {name for defect in defects for name in defect.images}
    keep = np.array([image.name not in names for image in network.images], dtype=bool)
    if keep.all() or not keep.any():
        return None
    less = sub_network(network, keep, np.ones(len(network.points), dtype=bool))
    surveyed = np.array([point.role in SURVEYED for point in less.points], dtype=bool)
    said = [phrase("left_out_image", "not oriented: {why}", why=defect.said) for defect in defects]
    return only_points(less, surveyed | (rays(less) > 0)), said
