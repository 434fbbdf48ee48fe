"""Makes a network with errors out of a plan: what would have been measured, for trying commands and for learning."""

from dataclasses import replace

import numpy as np

from photogrammetry.network.model import ImageFrame, Network, Point, Role
from photogrammetry.planning.plan import Plan
from photogrammetry.planning.sight import in_picture
from rig.arrays import Floats


def simulated_network(plan: Plan, seed: int) -> Network:
    """The planned network as it would be measured once: with normally distributed errors and without start values.

    Image points, surveyed targets and distances are measured with errors. Coordinate differences are not measured but
    hold within their sigma: a rod that is called vertical leans a little. Poses and unknown targets have no values,
    cameras the planned ones. Measurements are rounded to less than a hundredth of their sigma, as one would write them.

    Args:
        plan: the planned network.
        seed: of the random numbers; the same seed gives the same network.

    Returns:
        The network, in the pixel frame.
    """
    rng, exact = np.random.default_rng(seed), plan.network
    xyz = _leaning(exact, rng)
    observed = exact.observations
    shown = np.array([in_picture(exact.cameras[image.camera], image, xyz)[0] for image in exact.images])
    return replace(
        exact,
        images=tuple(replace(image, position=None, rotation=None) for image in exact.images),
        points=tuple(_surveyed(point, place, rng) for point, place in zip(exact.points, xyz, strict=True)),
        observations=replace(observed, xy=_measured(shown[observed.image, observed.point], plan.sigma, rng)),
        distances=tuple(
            replace(each, value=float(_measured(np.array(each.value), each.sigma, rng))) for each in exact.distances
        ),
        image_frame=ImageFrame.PIXEL,
    )


def _leaning(exact: Network, rng: np.random.Generator) -> Floats:
    """True places (points, 3) of the targets: as planned, but for the errors of coordinate differences.

    The end of a difference moves, and what a distance ties to it as the upper target of its rod; the start moves where
    the end is fixed.
    """
    xyz = np.array([point.xyz for point in exact.points], dtype=float).reshape(-1, 3)
    upper = {rod.start: rod.end for rod in exact.distances}
    for difference in exact.differences:
        error = rng.normal(0.0, difference.sigma)
        for end, shift in ((difference.end, error), (difference.start, -error)):
            if exact.points[end].role is not Role.FIXED:
                xyz[[end, *([upper[end]] if end in upper else [])], difference.axis] += shift
                break
    return xyz


def _surveyed(point: Point, place: Floats, rng: np.random.Generator) -> Point:
    """The point as it is known before the adjustment."""
    if point.role is Role.CONTROL and point.sigma is not None:
        return replace(point, xyz=_measured(place, float(point.sigma[0]), rng))
    return point if point.role is Role.FIXED else replace(point, xyz=None)


def _measured(true: Floats, sigma: float, rng: np.random.Generator) -> Floats:
    """Values with errors of standard deviation `sigma`, rounded to less than a hundredth of it."""
    digits = int(np.ceil(2.0 - np.log10(sigma)))
    return np.asarray(np.round(true + rng.normal(0.0, sigma, true.shape), digits))
