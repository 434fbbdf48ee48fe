"""Leaves out the fifth power of the radial distortion where the images do not ask for it.

Third power and decentring stay, though they may be insignificant: every lens has some. The principal point makes up for
a decentring that is left out, so that it would be off by many of its sigmas where a small one is there.
"""

from dataclasses import replace
from typing import Final

from photogrammetry.adjustment.equations.unknowns import state_of
from photogrammetry.adjustment.solution.adjustment import Adjustment, adjust_once
from photogrammetry.geometry.camera_model import INTERIOR
from photogrammetry.network.model import Camera, Network

_FIFTH: Final = "a2"


def with_significant(network: Network) -> tuple[Network, list[str]]:
    """The network whose cameras estimate the fifth power only where it is significant (5 %); elsewhere it is zero.

    Args:
        network: with start values of everything, free of gross errors.

    Returns:
        The network, and a line for each camera that does without.

    Raises:
        NotSolvableError, NotConvergedError: as the adjustment.
    """
    a = adjust_once(network, state_of(network))
    without = [_is_needless(a, i) for i in range(len(network.cameras))]
    cameras = tuple(_without(one) if out else one for one, out in zip(network.cameras, without, strict=True))
    names = [one.name for one, out in zip(network.cameras, without, strict=True) if out]
    return replace(network, cameras=cameras), [f"camera {name}: {_FIFTH} not significant, left out" for name in names]


def _is_needless(a: Adjustment, camera: int) -> bool:
    return any(parameter.name == _FIFTH and parameter.insignificant for parameter in a.parameters(camera)[0])


def _without(camera: Camera) -> Camera:
    interior = camera.interior.copy()
    interior[INTERIOR.index(_FIFTH)] = 0.0
    stays = tuple(name for name in camera.estimate if name != _FIFTH)
    sigma = {name: value for name, value in camera.sigma.items() if name != _FIFTH}
    return replace(camera, estimate=stays, interior=interior, sigma=sigma)
