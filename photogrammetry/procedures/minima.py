"""Other minima of an adjustment: surveyed points in a plane have two poses, in each image that shows them.

From far away a plane that is tilted towards the camera looks like one that is tilted away from it, so the sum of
squares has a minimum at both, and start values lead to either of them. From each adjustment the other minima are sought
here, with the poses of single images and of all of them reflected (`start_values.resection.second_pose`). The least
is taken. Where the sums of squares do not decide, nobody knows which pose is right.

Without surveyed points nothing is reflected: of a free network the minimum stands that its start values lead to.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Final

import numpy as np
from scipy import special

from photogrammetry.adjustment.equations.unknowns import State
from photogrammetry.adjustment.gross_errors.snooping import BENT
from photogrammetry.adjustment.gross_errors.suspicion import FAMILY_RISK, SINGLE_RISK
from photogrammetry.adjustment.run import Outcome, adjust
from photogrammetry.adjustment.solution.adjustment import Adjustment, adjust_once
from photogrammetry.adjustment.solution.statistics import A_PRIORI
from photogrammetry.geometry.ideal_camera import IdealCamera
from photogrammetry.network.diagnosis import NotConvergedError, NotSolvableError
from photogrammetry.network.model import Network, Reweight
from photogrammetry.network.selection import only_points, with_interior
from photogrammetry.procedures.findings import SURVEYED
from photogrammetry.procedures.left_out import naming_unplaced
from photogrammetry.start_values.image_block import ImageBlock
from photogrammetry.start_values.resection import second_pose
from photogrammetry.start_values.search import place_points
from photogrammetry.start_values.sightings import Sightings, reduce_observations
from rig.arrays import Flags, Floats
from rig.errors import BadInputError

#: A minimum is worse if its sum of squares is larger by so many variances. With normal errors a wrong pose beats the
#: right one by so much with a probability of exp(-25 / 2) = 4e-6: that of five sigmas.
WORSE: Final = 25.0
#: Times that: a reflected pose whose own image says so beforehand is not adjusted.
_HOPELESS: Final = 20.0
_POINTS_LEAST: Final = 4  # points of an image; three fit several poses exactly (`doubtful_poses`)
_COMBINED: Final = 3  # images of which all combinations are tried; of more of them each alone, and all together
_SAME: Final = 0.05  # sigmas of the projection centres by which one minimum differs from itself
_APART: Final = 1.0  # sigmas from which on two places of an image are two
_ROUNDS_MOST: Final = 4  # a better minimum may lead to one that is better still


def adjust_least(
    network: Network, start: State, given: Network, *, snoop: bool = False, family_risk: float = FAMILY_RISK
) -> Outcome:
    """Adjust a network, and go on from a better minimum if there is one.

    Args:
        network: the network.
        start: start values.
        given: the network before it got start values; its poses decide where the sums of squares do not.
        snoop: take out gross errors.
        family_risk: chance that anything at all is suspected in sound data.

    Raises:
        NotSolvableError, NotConvergedError, BadInputError: as `adjust`.
    """
    if snoop:
        start = _unbent(network, start, given)
    try:
        outcome = adjust(network, start, snoop=snoop, family_risk=family_risk)
    except NotConvergedError as error:
        raise naming_unplaced(error, network, start) from error
    for _ in range(_ROUNDS_MOST):
        # what was taken out beside the wrong pose need not be wrong beside the right one: all of it takes part again
        best = least_minimum(outcome.adjustment, given)
        if best is outcome.adjustment:
            break
        outcome = adjust(network, best.state, snoop=snoop, family_risk=family_risk)
    return outcome


def _unbent(network: Network, start: State, given: Network) -> State:
    """The least minimum where `start` leads to a bad one, beside which sound observations would be accused in turn."""
    try:
        reached = adjust_once(network, start)
    except (NotConvergedError, NotSolvableError):
        return start
    if reached.ratio <= BENT:
        return start
    return start if (best := least_minimum(reached, given)) is reached else best.state


@dataclass(frozen=True, slots=True, eq=False)
class Minimum:
    """A minimum of the sum of squares.

    Attributes:
        adjustment: the network there; without the tie points whose rays do not meet, where it is reached only so.
        square_sum: in a-priori variances; points that were left out count as much as at the first minimum.
    """

    adjustment: Adjustment
    square_sum: float

    @classmethod
    def of(cls, adjustment: Adjustment) -> "Minimum":
        """The minimum at which a whole network was adjusted."""
        return cls(adjustment, adjustment.equations.square_sum)


def minima(a: Adjustment) -> list[Minimum]:
    """The distinct minima of a surveyed network that reflected poses lead to, the least first.

    Args:
        a: the network at one minimum, which is among them.
    """
    if a.network.reweight is not Reweight.NONE:
        a = adjust_once(a.network, a.state)  # minima are compared with the weights as given
    found = [Minimum.of(a)]
    for start, determined in _reflected(a):
        reached = _reached(a, start, determined)
        if reached is not None and not any(_same(reached.adjustment, other.adjustment) for other in found):
            found.append(reached)
    return sorted(found, key=lambda one: one.square_sum)


def possible_minima(a: Adjustment, given: Network) -> list[Minimum]:
    """The minima between which the sums of squares do not decide.

    Args:
        a: the network at one minimum.
        given: the network before it got start values: only its poses are given.

    Returns:
        The least first; among those that differ in the place of images with given poses, the nearest to these first.
    """
    found = minima(a)
    possible = [one for one in found if not is_worse(one, found[0], a.redundancy)]
    return sorted(possible, key=lambda one: _off(one.adjustment, given))


def least_minimum(a: Adjustment, given: Network) -> Adjustment:
    """The least minimum; where the sums of squares do not decide, the one next to the given poses.

    Args:
        a: the network at one minimum.
        given: the network before it got start values.
    """
    for _ in range(_ROUNDS_MOST):
        found = (one.adjustment for one in possible_minima(a, given))
        best = next((one for one in found if len(one.network.points) == len(a.network.points)), a)
        if _same(best, a):
            break
        a = best
    return a


def is_worse(other: Minimum, best: Minimum, redundancy: int) -> bool:
    """Whether the sums of squares decide against a minimum: by the a-priori variances, and by those estimated.

    The turn from one pose to the other is one parameter, so the difference is tested with one degree of freedom (F
    test). The a-priori variance counts as a few observations beside the redundant ones, which may be two.

    Args:
        other: a minimum.
        best: the least one of the same network.
        redundancy: of the network.
    """
    difference = other.square_sum - best.square_sum
    freedom = redundancy + A_PRIORI
    variance = (best.square_sum + A_PRIORI) / freedom
    return bool(difference > WORSE and special.fdtrc(1, freedom, difference / variance) < SINGLE_RISK)


def moved_images(other: Adjustment, best: Adjustment) -> Flags:
    """(images,) whose projection centres differ between two minima by more than their sigmas."""
    return np.asarray(_shifts(other, best) > _APART)


def _off(a: Adjustment, given: Network) -> float:
    """How far the images lie from their given poses, all together; zero if none is given."""
    there = {image.name: image.position for image in given.images if image.rotation is not None}
    return float(
        sum(
            np.linalg.norm(place - known)
            for image, place in zip(a.network.images, a.state.position, strict=True)
            if (known := there.get(image.name)) is not None
        )
    )


def _same(one: Adjustment, other: Adjustment) -> bool:
    return one is other or bool((_shifts(one, other) <= _SAME).all())


def _shifts(one: Adjustment, other: Adjustment) -> Floats:
    """(images,) largest difference of a coordinate of X0, in its sigmas of the sharper minimum."""
    columns = other.problem.unknowns.pose[:, :3]
    sigma = np.minimum(one.sigmas(one.problem.unknowns.pose[:, :3]), other.sigmas(columns))
    apart = np.abs(one.state.position - other.state.position)
    return np.asarray(np.where(columns >= 0, apart / np.maximum(sigma, np.finfo(float).tiny), 0.0).max(axis=1))


def _reached(a: Adjustment, start: State, determined: Flags) -> Minimum | None:
    """The minimum from some start values, if need be without the tie points whose rays do not meet there."""
    try:
        reached = adjust_once(a.network, start)
    except (NotConvergedError, NotSolvableError):
        if determined.all():
            return None
        return _reached_without(a, start, determined)
    return Minimum.of(reached)


def _reached_without(a: Adjustment, start: State, determined: Flags) -> Minimum | None:
    network = only_points(a.network, determined)
    try:
        reached, here = (adjust_once(network, replace(s, xyz=s.xyz[determined])) for s in (start, a.state))
    except (NotConvergedError, NotSolvableError):
        return None
    if _same(reached, here):
        return None
    square_sums = (one.equations.square_sum for one in (reached, a, here))
    return Minimum(reached, next(square_sums) + next(square_sums) - next(square_sums))


def _reflected(a: Adjustment) -> Iterator[tuple[State, Flags]]:
    """Start values with reflected poses: of each image alone, of all together; of few images all combinations.

    With each (points,) whether the point is surveyed, or its rays meet.
    """
    surveyed = np.array([point.role in SURVEYED for point in a.network.points], dtype=bool)
    sightings = reduce_observations(with_interior(a.network, a.state.interior))
    others = {
        i: pose
        for i, image in enumerate(a.network.images)
        if image.estimate and (pose := _other_pose(a, sightings, surveyed, i)) is not None
    }
    images = list(others)
    for chosen in _combinations(len(images)):
        poses = {image: others[image] for image, turned in zip(images, chosen, strict=True) if turned}
        yield _started(a, sightings, surveyed, poses)


def _combinations(count: int) -> Iterator[Sequence[bool]]:
    if count <= _COMBINED:
        yield from (chosen for chosen in product((False, True), repeat=count) if any(chosen))
        return
    yield from ([i == k for i in range(count)] for k in range(count))
    yield [True] * count


def _other_pose(a: Adjustment, sightings: Sightings, surveyed: Flags, image: int) -> IdealCamera | None:
    """The reflected pose of an image by its surveyed points; None if there is none that might be as good."""
    points = sightings.points[image]
    known = surveyed[points]
    if known.sum() < _POINTS_LEAST:
        return None
    xyz, xy, sigma = a.state.xyz[points[known]], sightings.xy[image][known], sightings.sigma[image][known]
    camera = IdealCamera(sightings.c_of(image), a.state.position[image], a.state.rotation[image])
    if not camera.in_front(xyz).all():
        return None
    try:
        other = second_pose(camera, xyz, xy)
    except BadInputError:
        return None  # the points lie on a line
    if other is None:
        return None
    # what the survey's own errors may explain of the residuals, they shall
    depth = np.linalg.norm(xyz - camera.X0, axis=1)
    survey = np.array([_survey_sigma(a.network, int(i)) for i in points[known]])
    variance = sigma**2 + (camera.c / depth * survey) ** 2
    here, there = (
        float((((pose.project(xyz) - xy) ** 2).sum(axis=1) / variance).sum()) for pose in (camera, other.camera)
    )
    return other.camera if there - here < _HOPELESS * WORSE * max(1.0, a.ratio**2) else None


def _survey_sigma(network: Network, point: int) -> float:
    sigma = network.points[point].sigma
    return 0.0 if sigma is None else float(sigma.max())


def _started(
    a: Adjustment, sightings: Sightings, surveyed: Flags, poses: dict[int, IdealCamera]
) -> tuple[State, Flags]:
    """Start values with some poses replaced, and the points without survey intersected anew where they can be."""
    state = a.state
    cameras = {
        i: poses.get(i) or IdealCamera(sightings.c_of(i), state.position[i], state.rotation[i])
        for i in range(sightings.n_images)
    }
    xyz = np.where(surveyed[:, None], state.xyz, np.nan)
    block = ImageBlock(sightings, cameras, xyz, surveyed.copy(), set(cameras))
    block.intersect(caution=1.0)
    determined = block.known
    place_points(block)
    position, rotation = state.position.copy(), state.rotation.copy()
    for i, camera in poses.items():
        position[i], rotation[i] = camera.X0, camera.R
    return State(state.interior, position, rotation, block.xyz), determined
