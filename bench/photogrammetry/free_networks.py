"""Makes free networks of any size for benchmarks: cameras around a field of targets, start values off the truth."""

import numpy as np

from photogrammetry.geometry.camera_model import INTERIOR, image_point
from photogrammetry.geometry.rotation import rotation_from_vector
from photogrammetry.network.model import Camera, Datum, DatumType, Image, ImageObservations, Network, Point, Role
from rig.arrays import Floats
from rig.images.viewing import look_at

_SIGMA_PX = 0.2
_OFF_M, _OFF_RAD = 0.02, 0.01


def free_network(images: int, points: int, cameras: int, estimate: tuple[str, ...], seed: int = 1) -> Network:
    """A free network with noisy observations and disturbed start values; every image sees every point.

    Args:
        images: number of images, taken by the cameras in turn from about 5 m.
        points: number of targets in 2 x 2 x 1 m.
        cameras: number of cameras of 1000 px.
        estimate: unknown interior parameters of each camera.
        seed: of the random numbers.
    """
    rng = np.random.default_rng(seed)
    xyz = rng.uniform(-1.0, 1.0, (points, 3)) * (1.0, 1.0, 0.5)
    interior = np.zeros(len(INTERIOR))
    interior[[0, 3]] = 1000.0, 1e-8
    models = tuple(Camera(f"K{i + 1}", interior, estimate=estimate) for i in range(cameras))
    views, observed = [], []
    for i in range(images):
        position, rotation = _view(rng, i)
        observed.append(image_point(models[i % cameras].lens(), rotation, position, xyz))
        off = rotation @ rotation_from_vector(rng.normal(0.0, _OFF_RAD, 3))
        views.append(Image(f"i{i + 1}", i % cameras, position + rng.normal(0.0, _OFF_M, 3), off))
    n = images * points
    xy = np.concatenate(observed) + rng.normal(0.0, _SIGMA_PX, (n, 2))
    observations = ImageObservations(
        image=np.repeat(np.arange(images), points),
        point=np.tile(np.arange(points), images),
        xy=xy,
        sigma=np.full((n, 2), _SIGMA_PX),
        group=np.zeros(n, dtype=np.intp),
    )
    started = xyz + rng.normal(0.0, _OFF_M, xyz.shape)
    return Network(
        cameras=models,
        images=tuple(views),
        points=tuple(Point(f"P{i + 1}", Role.TIE, place) for i, place in enumerate(started)),
        observations=observations,
        datum=Datum(DatumType.INNER),
    )


def _view(rng: np.random.Generator, i: int) -> tuple[Floats, Floats]:
    """Position on a dome and rotation towards the field, rolled by multiples of a quarter turn."""
    azimuth, elevation = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(0.5, 1.3)
    away = np.array([np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)])
    return rng.uniform(4.0, 6.0) * away, look_at(away, np.zeros(3), -90.0 * (i % 4))
