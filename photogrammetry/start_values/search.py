"""Start values of a whole network, from nothing if need be: the paper's steps 1B and 2A.

Images that see enough known points are resected, points with enough rays intersected, in turns. Where that leads no
further, a pair of the remaining images is oriented relatively, a model is grown from it, and the model is carried into
the object system. What cannot be connected gets placeholders, so that the rank analysis of the adjustment can name
it.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np

from photogrammetry.geometry.ideal_camera import IdealCamera
from photogrammetry.geometry.similarity import fit_similarity
from photogrammetry.network.model import Network, Point, Role
from photogrammetry.start_values.block_frame import orient_block
from photogrammetry.start_values.image_block import ImageBlock, seed_block
from photogrammetry.start_values.principal_distances import adjust_block, from_control, open_cameras
from photogrammetry.start_values.sightings import Sightings, reduce_observations
from rig.arrays import Floats
from rig.errors import BadInputError

_FAR_OFF_SHARE = 0.1  # of the block's extent: approximate coordinates that are further off are ignored
_FITS = 3.0  # residuals over their sigmas: with smaller ones c is right
_FACTORS = (1.0, 0.5, 2.0, 0.25)  # tried on c: trial adjustments converge best from a c that is too short
_COMBINED, _ENOUGH_IMAGES = 3, 3  # all combinations for up to three cameras that have fewer than three images


def complete(network: Network) -> Network:
    """The network with start values for all poses and points that have none; given values stay.

    Args:
        network: any network. A principal distance that is to be estimated, and not observed, may be wrong by a factor
            of two; it is corrected if poses are missing.

    Returns:
        The network with values for every pose and point. Those that could not be determined have placeholders.

    Raises:
        BadInputError: the numbers are so absurd that nothing can be computed.
    """
    try:
        return _completed(network)
    except np.linalg.LinAlgError:
        raise BadInputError("the numbers leave all bounds; check units and sizes, or give start values") from None


def _completed(network: Network) -> Network:
    given = _given(network, reduce_observations(network))
    c = given.sightings.c.copy()
    cameras = open_cameras(network, given)
    for camera in list(cameras):
        found = from_control(given, camera)
        if found is not None:
            c[camera] = found
            cameras.remove(camera)
    block = _grown(network, given, c)
    if cameras and block.typical_residual() > _FITS:
        block = _with_better_c(network, given, block, cameras)
    _place_images(block)
    place_points(block)
    return _filled(network, block)


def _grown(network: Network, given: ImageBlock, c: Floats) -> ImageBlock:
    """A block grown with principal distances c (cameras,)."""
    block = given.with_c(c)
    block.grow(polish=False)
    _add_models(block, network)
    block.polish()
    block.intersect(caution=1.0)
    return block


def _with_better_c(network: Network, given: ImageBlock, first: ImageBlock, cameras: list[int]) -> ImageBlock:
    """Estimate c from the images alone by trial adjustments, which start from several values of c."""
    best, least = first, np.inf
    for factors in _factors(cameras, given.sightings):
        c = first.sightings.c.copy()
        c[cameras] *= factors
        block = first if (factors == 1).all() else _grown(network, given, c)
        trial = adjust_block(network, block)
        if trial is not None and trial[1] < least:
            best, least = trial
        if least < _FITS:
            break
    return best


def _factors(cameras: list[int], sightings: Sightings) -> Iterator[Floats]:
    """Factors on the c of these cameras to start from: common ones, then all combinations for cameras with few images.

    Three images of a camera determine its c. With fewer, errors of opposite sign in two cameras may compensate.
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
    """The given poses and points, in the object system."""
    block = ImageBlock(sightings)
    for index, image in enumerate(network.images):
        if image.position is not None and image.rotation is not None:
            block.cameras[index] = IdealCamera(sightings.c_of(index), image.position, image.rotation)
            block.settled.add(index)
    for index, point in enumerate(network.points):
        if point.role in {Role.CONTROL, Role.FIXED} and point.xyz is not None:
            block.xyz[index], block.held[index] = point.xyz, True
    return block


def _add_models(block: ImageBlock, network: Network) -> None:
    """Orient the remaining images: grow models from pairs of them and carry these into the object system."""
    while missing := [i for i in range(block.sightings.n_images) if i not in block.cameras]:
        model = seed_block(block.sightings, missing)
        if model is None:
            break
        model.grow()
        _join(block, model, network)
        _merge(block, model)
        block.grow(polish=False)


def _join(block: ImageBlock, model: ImageBlock, network: Network) -> None:
    """Carry the model into the system of the block, by common points or by what ties it to the object system."""
    common = np.flatnonzero(block.known & model.known)
    if len(common) >= 3:
        try:
            model.transform(fit_similarity(model.xyz[common], block.xyz[common]))
        except BadInputError:
            pass  # common points on a line: distances and differences may help
        else:
            return
    orient_block(model, network)


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


def _filled_point(point: Point, xyz: Floats, extent: float) -> Point:
    """Given coordinates stay, except approximate ones of a tie point that are far from where the images put it."""
    if point.xyz is None:
        return replace(point, xyz=xyz)
    if point.role is Role.TIE and np.linalg.norm(point.xyz - xyz) > _FAR_OFF_SHARE * extent:
        return replace(point, xyz=xyz)
    return point


def _place_images(block: ImageBlock) -> None:
    """Give images without a pose one that looks at the middle of the block from its usual distance."""
    middle, size = _extent(block)
    distances = [float(np.linalg.norm(camera.X0 - middle)) for camera in block.cameras.values()]
    place = middle + np.array([0.0, 0.0, 2 * size + (float(np.median(distances)) if distances else 0.0)])
    for image in range(block.sightings.n_images):
        if image not in block.cameras:
            block.cameras[image] = IdealCamera(block.sightings.c_of(image), place, np.eye(3))


def place_points(block: ImageBlock) -> None:
    """Put points without coordinates onto their first ray, or into the middle of the block.

    Args:
        block: all its images have a pose; changed in place.
    """
    middle, size = _extent(block)
    seen = block.sightings.seen()
    for point in np.flatnonzero(~block.known):
        images = np.flatnonzero(seen[:, point])
        block.xyz[point] = _on_ray(block, int(images[0]), int(point), middle, size) if len(images) else middle


def _on_ray(block: ImageBlock, image: int, point: int, middle: Floats, size: float) -> Floats:
    sightings, camera = block.sightings, block.cameras[image]
    xy = sightings.xy[image][np.searchsorted(sightings.points[image], point)]
    distance = float(np.linalg.norm(middle - camera.X0)) or size
    return camera.X0 + distance * camera.rays(xy)


def _extent(block: ImageBlock) -> tuple[Floats, float]:
    """Centroid and size of the known points."""
    points = block.xyz[block.known]
    if not len(points):
        return np.zeros(3), 1.0
    middle = points.mean(axis=0)
    return middle, float(np.sqrt(((points - middle) ** 2).sum(axis=1).max())) or 1.0
