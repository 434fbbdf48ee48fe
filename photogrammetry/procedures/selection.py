"""Parts of a network: without its survey, without some of its points or observations."""

from collections.abc import Collection
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from photogrammetry.network import Datum, DatumType, Network, Point, Reweight, Role
from rig.errors import BadInputError

_RAYS = 2  # that a point needs without a survey


def rays(network: Network) -> NDArray[np.intp]:
    """Number of images that show each point: (points,)."""
    return np.bincount(network.observations.point, minlength=len(network.points))


def only_points(network: Network, chosen: NDArray[np.bool_]) -> Network:
    """The network of some of its points, with what was observed of them; all of them are datum points.

    Args:
        network: any network.
        chosen: (points,) which ones stay.
    """
    place = np.where(chosen, np.cumsum(chosen) - 1, -1)
    o = network.observations
    left = chosen[o.point]
    parts = {name: getattr(o, name)[left] for name in ("image", "xy", "sigma", "group")}
    return replace(
        network,
        points=tuple(point for point, stays in zip(network.points, chosen, strict=True) if stays),
        observations=replace(o, point=place[o.point[left]], **parts),
        distances=tuple(
            replace(d, start=int(place[d.start]), end=int(place[d.end]))
            for d in network.distances
            if chosen[d.start] and chosen[d.end]
        ),
        differences=tuple(
            replace(d, start=int(place[d.start]), end=int(place[d.end]))
            for d in network.differences
            if chosen[d.start] and chosen[d.end]
        ),
        datum=replace(network.datum, points=None),
    )


def observation_names(network: Network) -> list[tuple[str, str]]:
    """Image and point of each image observation."""
    o = network.observations
    return [(network.images[i].name, network.points[j].name) for i, j in zip(o.image, o.point, strict=True)]


def without_observations(network: Network, gone: Collection[tuple[str, str]]) -> Network:
    """The network without some image observations, named by image and point."""
    o = network.observations
    left = np.array([names not in gone for names in observation_names(network)], dtype=bool)
    parts = {name: getattr(o, name)[left] for name in ("image", "point", "xy", "sigma", "group")}
    return replace(network, observations=replace(o, **parts))


def as_check_points(network: Network, names: Collection[str]) -> Network:
    """The network with some of its surveyed points compared afterwards only."""
    points = tuple(replace(p, role=Role.CHECK, sigma=None) if p.name in names else p for p in network.points)
    return replace(network, points=points)


def without_survey(network: Network) -> Network:
    """The free network of the images alone: no point, distance, difference or pose is known beforehand.

    Points that fewer than two images show are left out: the images alone do not determine them.
    """
    seen = only_points(network, rays(network) >= _RAYS)
    return replace(
        seen,
        points=tuple(Point(point.name, Role.TIE) for point in seen.points),
        images=tuple(replace(image, sigma_position=None, sigma_angles=None) for image in seen.images),
        distances=(),
        differences=(),
        datum=Datum(DatumType.INNER),
        reweight=Reweight.NONE,
    )


def require_unknown_poses(network: Network, procedure: str) -> None:
    """Refuse constant poses where a procedure estimates all of them.

    Raises:
        BadInputError: names the image.
    """
    for image in network.images:
        if not image.estimate:
            raise BadInputError(
                f'images.{image.name}: the pose is constant ("estimate": false), but {procedure} estimates all poses; '
                "remove that key, or use svev adjust"
            )
