"""Makes a network with errors out of a plan: what would have been measured, for trying commands and for learning."""

from dataclasses import replace

import numpy as np

from photogrammetry.network.model import ImageFrame, Network, Point, Role
from photogrammetry.planning.plan import Plan
from rig.arrays import Floats


def simulated_network(plan: Plan, seed: int) -> Network:
    """The planned network as it would be measured once: with normally distributed errors and without start values.

    Poses and unknown targets have no values, cameras have the planned ones. Measurements are rounded to less than a
    hundredth of their sigma, as one would write them down.

    Args:
        plan: the planned network.
        seed: of the random numbers; the same seed gives the same network.

    Returns:
        The network, in the pixel frame.
    """
    rng, exact = np.random.default_rng(seed), plan.network
    observed = exact.observations
    return replace(
        exact,
        images=tuple(replace(image, position=None, rotation=None) for image in exact.images),
        points=tuple(_surveyed(point, rng) for point in exact.points),
        observations=replace(observed, xy=_measured(observed.xy, plan.sigma, rng)),
        distances=tuple(
            replace(each, value=float(_measured(np.array(each.value), each.sigma, rng))) for each in exact.distances
        ),
        differences=tuple(
            replace(each, value=float(_measured(np.array(each.value), each.sigma, rng))) for each in exact.differences
        ),
        image_frame=ImageFrame.PIXEL,
    )


def _surveyed(point: Point, rng: np.random.Generator) -> Point:
    """The point as it is known before the adjustment."""
    if point.role is Role.CONTROL and point.xyz is not None and point.sigma is not None:
        return replace(point, xyz=_measured(point.xyz, float(point.sigma[0]), rng))
    return point if point.role is Role.FIXED else replace(point, xyz=None)


def _measured(true: Floats, sigma: float, rng: np.random.Generator) -> Floats:
    """Values with errors of standard deviation `sigma`, rounded to less than a hundredth of it."""
    digits = int(np.ceil(2.0 - np.log10(sigma)))
    return np.asarray(np.round(true + rng.normal(0.0, sigma, true.shape), digits))
