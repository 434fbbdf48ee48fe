"""Start values of a whole network without luck: the paper's steps 1B and 2A.

Images that see enough known points are resected, points with enough rays intersected, in turns. Where that leads no
further, a pair of the remaining images is oriented relatively, a model is grown from it, and the model is carried into
the object system. What cannot be connected is said, and gets placeholders, so that the adjustment can diagnose it.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from photogrammetry.ideal_camera import Array, IdealCamera
from photogrammetry.network import Network, Point, Role
from photogrammetry.similarity import fit_similarity
from photogrammetry.start_values.block_frame import orient_block
from photogrammetry.start_values.block_seed import seed_block
from photogrammetry.start_values.image_block import ImageBlock
from photogrammetry.start_values.placeholders import place_images, place_points
from photogrammetry.start_values.principal_distances import from_control, open_cameras
from photogrammetry.start_values.sightings import Sightings, reduce_observations
from photogrammetry.start_values.trial_adjustment import adjust_block
from rig.errors import BadInputError

_FAR = 0.1  # of the block's extent
_FITS = 3.0  # residuals over their sigmas that leave no doubt about c
_FACTORS = (1.0, 0.5, 2.0, 0.25)  # on c: the trial adjustment converges best from a c that is too short
_COMBINED, _ENOUGH_IMAGES = 3, 3  # up to so many cameras with fewer images are tried in all combinations


@dataclass(frozen=True, slots=True, eq=False)
class StartValues:
    """A network with values for everything.

    Attributes:
        network: every pose and every point has values, and principal distances are near the truth.
        words: what could not be determined, and why; empty if everything was. Those have placeholders in the network.
    """

    network: Network
    words: tuple[str, ...]


def complete(network: Network) -> Network:
    """The network with start values for all poses and points that have none.

    Raises:
        BadInputError: the numbers are so absurd that nothing can be computed.
    """
    try:
        return find_start_values(network).network
    except np.linalg.LinAlgError:
        raise BadInputError("the numbers leave all bounds; check units and sizes, or give start values") from None


def find_start_values(network: Network) -> StartValues:
    """Start values for all poses and points that have none; what is given stays as it is.

    Args:
        network: any network. A principal distance that is to be estimated, and not observed, may be wrong by a factor
            of two; it is put right where poses are missing.

    Returns:
        The complete network, and in words what had to be made up.
    """
    given = _given(network, reduce_observations(network))
    c = given.sightings.c.copy()
    cameras = open_cameras(network, given)
    for camera in list(cameras):
        found = from_control(given, camera)
        if found is not None:
            c[camera] = found
            cameras.remove(camera)
    attempt = _attempt(network, given, c)
    if cameras and attempt.block.typical_residual() > _FITS:
        attempt = _with_better_c(network, given, attempt, cameras)
    block = attempt.block
    words = [*attempt.words, *place_images(block, network), *place_points(block, network)]
    return StartValues(_filled(network, block), tuple(words))


@dataclass(frozen=True, slots=True, eq=False)
class _Attempt:
    """A block grown with certain principal distances."""

    block: ImageBlock
    words: tuple[str, ...]


def _attempt(network: Network, given: ImageBlock, c: Array) -> _Attempt:
    block = given.with_c(c)
    block.grow(polish=False)
    words = _add_models(block, network)
    block.polish()
    block.intersect(caution=1.0)
    return _Attempt(block, tuple(words))


def _with_better_c(network: Network, given: ImageBlock, first: _Attempt, cameras: list[int]) -> _Attempt:
    """Where only the images can tell c, a trial adjustment finds it; it may need another value to start from."""
    best, least = first, np.inf
    for factors in _factors(cameras, given.sightings):
        c = first.block.sightings.c.copy()
        c[cameras] *= factors
        attempt = first if (factors == 1).all() else _attempt(network, given, c)
        trial = adjust_block(network, attempt.block)
        if trial is not None and trial.ratio < least:
            best, least = _Attempt(trial.block, attempt.words), trial.ratio
        if least < _FITS:
            break
    return best


def _factors(cameras: list[int], sightings: Sightings) -> Iterator[Array]:
    """Factors on the c of these cameras to start from: common ones, then of cameras with few images all combinations.

    A camera with three images finds its own c; with fewer, errors of opposite sense may hide each other.
    """
    for factor in _FACTORS:
        yield np.full(len(cameras), factor)
    few = [k for k, camera in enumerate(cameras) if (sightings.camera == camera).sum() < _ENOUGH_IMAGES][:_COMBINED]
    for combination in product((1.0, 0.5, 2.0), repeat=len(few)):
        if len(set(combination)) > 1:
            factors = np.ones(len(cameras))
            factors[few] = combination
            yield factors


def _given(network: Network, sightings: Sightings) -> ImageBlock:
    """What the network brings along, in the object system."""
    block = ImageBlock(sightings)
    for index, image in enumerate(network.images):
        if image.position is not None and image.rotation is not None:
            block.cameras[index] = IdealCamera(sightings.c_of(index), image.position, image.rotation)
            block.settled.add(index)
    for index, point in enumerate(network.points):
        if point.role in {Role.CONTROL, Role.FIXED} and point.xyz is not None:
            block.xyz[index], block.held[index] = point.xyz, True
    return block


def _add_models(block: ImageBlock, network: Network) -> list[str]:
    """Orient the images that are left, by models of their own that are carried into the object system."""
    words = []
    while missing := [i for i in range(block.sightings.n_images) if i not in block.cameras]:
        model = seed_block(block.sightings, missing)
        if model is None:
            break
        model.grow()
        if not _join(block, model, network):
            names = [network.images[i].name for i in sorted(set(model.cameras) - set(block.cameras))]
            words.append(
                f"images {', '.join(names)} form a block of their own: measure three points that other images show too"
            )
        _merge(block, model)
        block.grow(polish=False)
    return words


def _join(block: ImageBlock, model: ImageBlock, network: Network) -> bool:
    """Carry the model into the system of the block; whether it is known where it belongs."""
    common = np.flatnonzero(block.known & model.known)
    if len(common) >= 3:
        try:
            model.transform(fit_similarity(model.xyz[common], block.xyz[common]).transform)
        except BadInputError:
            pass  # common points on a line: distances and differences may help
        else:
            return True
    orient_block(model, network)
    return not block.cameras


def _merge(block: ImageBlock, model: ImageBlock) -> None:
    new = model.known & ~block.known
    block.xyz[new] = model.xyz[new]
    block.cameras.update({image: camera for image, camera in model.cameras.items() if image not in block.cameras})


def _filled(network: Network, block: ImageBlock) -> Network:
    images = tuple(
        replace(image, position=block.cameras[i].X0, rotation=block.cameras[i].R)
        if image.position is None or image.rotation is None
        else image
        for i, image in enumerate(network.images)
    )
    extent = float(np.ptp(block.xyz, axis=0).max()) if len(block.xyz) else 0.0
    points = tuple(_filled_point(point, xyz, extent) for point, xyz in zip(network.points, block.xyz, strict=True))
    cameras = tuple(
        replace(camera, interior=np.array([c, *camera.interior[1:]]))
        for camera, c in zip(network.cameras, block.sightings.c, strict=True)
    )
    return replace(network, cameras=cameras, images=images, points=points)


def _filled_point(point: Point, xyz: Array, extent: float) -> Point:
    """Given coordinates stay; but those of a tie point are approximate, and far from the others they are of no use."""
    if point.xyz is None:
        return replace(point, xyz=xyz)
    if point.role is Role.TIE and np.linalg.norm(point.xyz - xyz) > _FAR * extent:
        return replace(point, xyz=xyz)
    return point
