"""Whether the pictures of a camera are of one lens: zoom or focus may have been changed, or two cameras be mixed."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from photogrammetry.adjustment.equations.unknowns import state_of
from photogrammetry.adjustment.solution.adjustment import Adjustment, adjust_once
from photogrammetry.network.diagnosis import NotConvergedError
from photogrammetry.network.model import Camera, Network
from photogrammetry.network.selection import RAYS, sub_network
from rig.errors import BadInputError
from rig.phrase import phrase

#: Residuals that are so many times their sigmas ask for another explanation than measuring errors ...
_DOUBTFUL: Final = 2.0
#: ... and two lenses are one if they take them down to this part.
_EXPLAINED: Final = 0.5
#: Pictures of a camera, below which two lenses explain anything.
_PICTURES_LEAST: Final = 6


def of_one_lens(network: Network) -> tuple[Network, list[str]]:
    """The network without single pictures that contradict the others of their camera, and a line for each.

    Args:
        network: with start values, all cameras estimating the same.

    Raises:
        BadInputError: two lenses explain several pictures of a camera, and one does not; names the pictures.
        NotSolvableError: as the adjustment.
    """
    notes: list[str] = []
    while True:
        a = adjusted_or_none(network)
        found = None if a is not None and a.ratio < _DOUBTFUL else _two_lenses(network, a)
        if found is None:
            return network, notes
        camera, odd, (c, other) = found
        if len(odd) > 1:
            names = ", ".join(network.images[k].name for k in odd)
            text = (
                "camera {camera}: pictures of two lenses: c is {other} px in {pictures}, and {c} px in the others: "
                "zoom or focus was changed in between, or pictures of another camera are among them; put the pictures "
                "of each lens into a folder of its own"
            )
            name = network.cameras[camera].name
            raise BadInputError(
                phrase("why_two_lenses", text, camera=name, other=round(other), pictures=names, c=round(c))
            )
        notes.append(
            f"{network.images[odd[0]].name} is left out: it contradicts all others: zoom or focus was another one, it "
            "is of another camera, or the target bent"
        )
        network = _without_image(network, odd[0])


def _two_lenses(network: Network, a: Adjustment | None) -> tuple[int, list[int], tuple[float, float]] | None:
    """A camera whose pictures are of two lenses, those of the second one, and both principal distances."""
    for i in range(len(network.cameras)):
        tried = [(odd, adjusted_or_none(_with_second(network, i, odd))) for odd in _parts(network, i)]
        solved = [(odd, two) for odd, two in tried if two is not None]
        if solved:
            odd, two = min(solved, key=lambda each: each[1].ratio)
            if a is None or two.ratio < _EXPLAINED * a.ratio:
                return i, odd, (float(two.state.interior[i, 0]), float(two.state.interior[len(network.cameras), 0]))
    return None


def _without_image(network: Network, image: int) -> Network:
    stays = np.arange(len(network.images)) != image
    o = network.observations
    rays = np.bincount(o.point[o.image != image], minlength=len(network.points))
    return sub_network(network, stays, rays >= RAYS)


def _parts(network: Network, camera: int) -> list[list[int]]:
    """Parts of a camera's images that another lens may have taken: single ones, the last ones, those of another c."""
    mine = [k for k, image in enumerate(network.images) if image.camera == camera]
    if len(mine) < _PICTURES_LEAST:
        return []
    by_name = [mine[n:] if 2 * n > len(mine) else mine[:n] for n in range(2, len(mine) - 1)]
    return [*([k] for k in mine), *by_name, *_of_another_c(network, camera, mine)]


def _of_another_c(network: Network, camera: int, mine: Sequence[int]) -> list[list[int]]:
    """The smaller part of a camera's images, by the widest gap between the principal distances of single ones."""
    others, one = len(network.cameras), network.cameras[camera]
    cameras = tuple(replace(each, estimate=("c",), sigma={"c": each.sigma["c"]}) for each in network.cameras)
    own = tuple(replace(cameras[camera], name=f"{one.name} {k}") for k in mine[1:])
    split = replace(network, cameras=(*cameras, *own))
    for number, k in enumerate(mine[1:]):
        split = _moved_to(split, [k], others + number)
    if (a := adjusted_or_none(split)) is None:
        return []
    c = np.array([a.state.interior[camera, 0], *a.state.interior[others:, 0]])
    order = np.argsort(c)
    gap = int(np.diff(np.log(np.maximum(c[order], 1e-9))).argmax()) + 1
    few, _ = sorted((order[:gap].tolist(), order[gap:].tolist()), key=len)
    return [sorted(mine[k] for k in few)]


def _with_second(network: Network, camera: int, odd: Sequence[int]) -> Network:
    second: Camera = replace(network.cameras[camera], name=f"{network.cameras[camera].name} (other lens)")
    return _moved_to(replace(network, cameras=(*network.cameras, second)), odd, len(network.cameras))


def _moved_to(network: Network, images: Sequence[int], camera: int) -> Network:
    return replace(
        network,
        images=tuple(replace(image, camera=camera) if k in images else image for k, image in enumerate(network.images)),
    )


def adjusted_or_none(network: Network) -> Adjustment | None:
    """The adjusted network; None if it cannot be."""
    try:
        return adjust_once(network, state_of(network))
    except NotConvergedError:
        return None
