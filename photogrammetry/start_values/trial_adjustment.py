"""Adjustment of what a block has of its network, to learn the principal distances before everything is known."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from photogrammetry.adjustment.adjustment import Adjustment, adjust_once
from photogrammetry.diagnosis import NotConvergedError, NotSolvableError
from photogrammetry.ideal_camera import IdealCamera
from photogrammetry.network import Camera, Datum, DatumType, Difference, Distance, Network, Reweight, Role
from photogrammetry.start_values.image_block import ImageBlock

_MIN_RAYS = 2

_Relation = TypeVar("_Relation", Distance, Difference)


@dataclass(frozen=True, slots=True, eq=False)
class Trial:
    """An adjusted block.

    Attributes:
        block: with adjusted principal distances, poses and points.
        ratio: estimated over a-priori sigma0.
    """

    block: ImageBlock
    ratio: float


def adjust_block(network: Network, block: ImageBlock) -> Trial | None:
    """Adjust the oriented images and the points with two rays or more, as the network asks for.

    Args:
        network: the whole network.
        block: poses and coordinates as start values; not changed.

    Returns:
        The adjusted block, in the network's datum, or free if that does not hold it; None if no optimum was reached.
    """
    images, points = _determined(block)
    part = _part(network, block, images, points)
    for candidate in (part, _free(part)):
        try:
            return _trial(block, adjust_once(candidate), images, points)
        except NotSolvableError:
            continue  # without the network's datum it may be solvable
        except NotConvergedError:
            return None
    return None


def _determined(block: ImageBlock) -> tuple[list[int], NDArray[np.intp]]:
    """Oriented images, and points with enough rays that lie in front of all images that show them."""
    images = sorted(block.cameras)
    rays = block.sightings.seen()[images].sum(axis=0)
    good = block.known & ((rays >= _MIN_RAYS) | (block.held & (rays > 0)))
    for image, camera in block.cameras.items():
        shown = block.sightings.points[image]
        good[shown] &= camera.in_front(block.xyz[shown])
    return images, np.flatnonzero(good)


def _part(network: Network, block: ImageBlock, images: list[int], points: NDArray[np.intp]) -> Network:
    """The network of these images and points alone, with the block's values; indices change."""
    image_at = np.full(len(network.images), -1)
    image_at[images] = np.arange(len(images))
    point_at = np.full(len(network.points), -1)
    point_at[points] = np.arange(len(points))
    o = network.observations
    rows = (image_at[o.image] >= 0) & (point_at[o.point] >= 0)
    seen = replace(
        o,
        image=image_at[o.image[rows]],
        point=point_at[o.point[rows]],
        xy=o.xy[rows],
        sigma=o.sigma[rows],
        group=o.group[rows],
    )

    oriented = tuple(
        replace(network.images[i], position=block.cameras[i].X0, rotation=block.cameras[i].R) for i in images
    )
    known = tuple(
        network.points[i] if block.held[i] else replace(network.points[i], role=Role.TIE, xyz=block.xyz[i])
        for i in points
    )
    return replace(
        network,
        cameras=_cameras(network, block, images),
        images=oriented,
        points=known,
        observations=seen,
        distances=tuple(_moved(network.distances, point_at)),
        differences=tuple(_moved(network.differences, point_at)),
        datum=Datum(network.datum.type),
        reweight=Reweight.NONE,
    )


def _cameras(network: Network, block: ImageBlock, images: list[int]) -> tuple[Camera, ...]:
    """The cameras with the block's principal distances; those without an image keep all their parameters."""
    used = set(block.sightings.camera[images].tolist())
    return tuple(
        replace(
            camera,
            interior=np.array([block.sightings.c[i], *camera.interior[1:]]),
            estimate=camera.estimate if i in used else (),
        )
        for i, camera in enumerate(network.cameras)
    )


def _moved(relations: Iterable[_Relation], point_at: NDArray[np.intp]) -> Iterator[_Relation]:
    for relation in relations:
        start, end = int(point_at[relation.start]), int(point_at[relation.end])
        if start >= 0 and end >= 0:
            yield replace(relation, start=start, end=end)


def _free(part: Network) -> Network:
    """By the images alone: no control, no distances, inner constraints."""
    points = tuple(replace(point, role=Role.TIE, sigma=None) for point in part.points)
    return replace(part, points=points, distances=(), differences=(), datum=Datum(DatumType.INNER))


def _trial(block: ImageBlock, adjusted: Adjustment, images: list[int], points: NDArray[np.intp]) -> Trial:
    state = adjusted.state
    found = block.with_c(state.interior[:, 0])
    for image, position, rotation in zip(images, state.position, state.rotation, strict=True):
        if image not in found.settled:
            found.cameras[image] = IdealCamera(found.sightings.c_of(image), position, rotation)
    loose = ~found.held[points]
    found.xyz[points[loose]] = state.xyz[loose]
    return Trial(found, adjusted.ratio)
