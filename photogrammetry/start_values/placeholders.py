"""Places for what the observations do not determine, so that the adjustment can run and diagnose it; and the words."""

from collections.abc import Sequence

import numpy as np

from photogrammetry.ideal_camera import Array, IdealCamera
from photogrammetry.network import Network, Role
from photogrammetry.start_values.image_block import ImageBlock

_NAMED = 5  # so many names in a message; of the others the number


def place_images(block: ImageBlock, network: Network) -> list[str]:
    """Give images without a pose one that looks at the middle of the block from its usual distance.

    Args:
        block: changed in place.
        network: for names.

    Returns:
        What is wrong with each of those images.
    """
    missing = [i for i in range(block.sightings.n_images) if i not in block.cameras]
    words = []
    for image in missing:
        known = int(block.known[block.sightings.points[image]].sum())
        words.append(_image_words(network.images[image].name, known, len(block.sightings.points[image])))
    middle, size = _extent(block)
    distances = [float(np.linalg.norm(camera.X0 - middle)) for camera in block.cameras.values()]
    distance = 2 * size + (float(np.median(distances)) if distances else 0.0)
    for image in missing:
        block.cameras[image] = IdealCamera(
            block.sightings.c_of(image), middle + np.array([0.0, 0.0, distance]), np.eye(3)
        )
    return words


def place_points(block: ImageBlock, network: Network) -> list[str]:
    """Put points without coordinates on their ray, or in the middle of the block.

    Args:
        block: changed in place; all images have a pose.
        network: for names and given coordinates.

    Returns:
        What is wrong with those points that have no given coordinates either.
    """
    middle, size = _extent(block)
    seen = block.sightings.seen()
    without: dict[str, list[str]] = {}
    for point in np.flatnonzero(~block.known):
        images = np.flatnonzero(seen[:, point])
        block.xyz[point] = middle
        if len(images):
            block.xyz[point] = _on_ray(block, int(images[0]), int(point), middle, size)
        if network.points[point].xyz is None and network.points[point].role not in {Role.CONTROL, Role.FIXED}:
            why = {0: "no image shows", 1: "only one image shows"}.get(len(images), "no two oriented images determine")
            without.setdefault(why, []).append(network.points[point].name)
    return [f"{why} {_named('point', names)}: measure in more images" for why, names in without.items()]


def _image_words(name: str, known: int, seen: int) -> str:
    if seen < 3:
        return f"image {name} shows {seen} points, three are needed: measure more points in it"
    return (
        f"image {name} cannot be connected, {known} of the points it shows have coordinates from elsewhere: "
        "measure more common points"
    )


def _on_ray(block: ImageBlock, image: int, point: int, middle: Array, size: float) -> Array:
    sightings, camera = block.sightings, block.cameras[image]
    xy = sightings.xy[image][np.searchsorted(sightings.points[image], point)]
    distance = float(np.linalg.norm(middle - camera.X0)) or size
    return camera.X0 + distance * camera.rays(xy)


def _extent(block: ImageBlock) -> tuple[Array, float]:
    """Centroid and size of the known points."""
    points = block.xyz[block.known]
    if not len(points):
        return np.zeros(3), 1.0
    middle = points.mean(axis=0)
    return middle, float(np.sqrt(((points - middle) ** 2).sum(axis=1).max())) or 1.0


def _named(what: str, names: Sequence[str]) -> str:
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return f"{what}{'s' if len(names) > 1 else ''} {', '.join(names[:_NAMED])}{more}"
