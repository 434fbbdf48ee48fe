"""Parts of a network: some of its images, points or observations; the images alone without the survey."""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from photogrammetry.network.model import (
    Datum,
    DatumType,
    Difference,
    Distance,
    ImageObservations,
    Network,
    Point,
    Reweight,
    Role,
)
from rig.arrays import Flags, Floats, Integers
from rig.errors import BadInputError

_Relation = TypeVar("_Relation", Distance, Difference)

#: A point without survey needs at least so many.
RAYS = 2
_DATUM_POINTS = 4
_THIN = 0.02  # second to first extent of points that are nearly a line


def rays(network: Network) -> Integers:
    """Number of images that show each point: (points,)."""
    return np.bincount(network.observations.point, minlength=len(network.points))


def only_observations(network: Network, chosen: Flags) -> Network:
    """The network with some of its image observations: those where `chosen` (n,) is true."""
    o = network.observations
    left = ImageObservations(o.image[chosen], o.point[chosen], o.xy[chosen], o.sigma[chosen], o.group[chosen], o.groups)
    return replace(network, observations=left)


def only_points(network: Network, chosen: Flags) -> Network:
    """The network of some of its points, with what was observed of them; all of them are datum points.

    Args:
        network: any network.
        chosen: (points,) which ones stay.
    """
    return sub_network(network, np.ones(len(network.images), dtype=bool), chosen)


def sub_network(network: Network, images: Flags, points: Flags) -> Network:
    """The network of some of its images and points, with all observations between them; indices change.

    All points that stay are datum points.

    Args:
        network: any network; its cameras all stay.
        images: (images,) which images stay.
        points: (points,) which points stay.
    """
    image_at, point_at = (np.where(chosen, np.cumsum(chosen) - 1, -1) for chosen in (images, points))
    o = network.observations
    seen = only_observations(network, images[o.image] & points[o.point])
    o = seen.observations
    return replace(
        seen,
        images=tuple(image for image, stays in zip(network.images, images, strict=True) if stays),
        points=tuple(point for point, stays in zip(network.points, points, strict=True) if stays),
        observations=replace(o, image=image_at[o.image], point=point_at[o.point]),
        distances=_renumbered(network.distances, point_at),
        differences=_renumbered(network.differences, point_at),
        datum=Datum(network.datum.type),
    )


def _renumbered(relations: Iterable[_Relation], point_at: Integers) -> tuple[_Relation, ...]:
    """Distances or differences between points that stay, with the points' new indices; -1: the point is gone."""
    ends = ((relation, int(point_at[relation.start]), int(point_at[relation.end])) for relation in relations)
    return tuple(replace(relation, start=i, end=j) for relation, i, j in ends if min(i, j) >= 0)


def observation_names(network: Network) -> list[tuple[str, str]]:
    """Image and point of each image observation."""
    o = network.observations
    return [(network.images[i].name, network.points[j].name) for i, j in zip(o.image, o.point, strict=True)]


def without_observations(network: Network, gone: Collection[tuple[str, str]]) -> Network:
    """The network without some image observations, named by image and point."""
    return only_observations(network, np.array([names not in gone for names in observation_names(network)], dtype=bool))


def as_check_points(network: Network, names: Collection[str]) -> Network:
    """The network with some of its surveyed points turned into check points."""
    points = tuple(replace(p, role=Role.CHECK, sigma=None) if p.name in names else p for p in network.points)
    return replace(network, points=points)


def without_survey(network: Network) -> Network:
    """The free network of the images alone, without any surveyed point, distance, difference or weighted pose.

    Points that fewer than two images show are left out: the images alone do not determine them. The points that were
    surveyed define the datum, if there are enough: a far tie point would make all coordinates uncertain.
    """
    seen = only_points(network, rays(network) >= RAYS)
    surveyed = [i for i, p in enumerate(seen.points) if p.role in (Role.CONTROL, Role.FIXED) and p.xyz is not None]
    return replace(
        seen,
        points=tuple(Point(point.name, Role.TIE) for point in seen.points),
        images=tuple(replace(image, sigma_position=None, sigma_angles=None) for image in seen.images),
        distances=(),
        differences=(),
        datum=Datum(DatumType.INNER, tuple(surveyed) if _spread([seen.points[i].xyz for i in surveyed]) else None),
        reweight=Reweight.NONE,
    )


def _spread(places: Sequence[Floats | None]) -> bool:
    """Whether points define a datum: four at least, clearly not on a line."""
    if len(places) < _DATUM_POINTS:
        return False
    xyz = np.array(places, dtype=float)
    extent = np.linalg.svd(xyz - xyz.mean(axis=0), compute_uv=False)
    return bool(extent[1] > _THIN * extent[0])


def with_interior(network: Network, interior: Floats) -> Network:
    """The network with other interior orientations (cameras, 10)."""
    cameras = tuple(replace(camera, interior=values) for camera, values in zip(network.cameras, interior, strict=True))
    return replace(network, cameras=cameras)


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
