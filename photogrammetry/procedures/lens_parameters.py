"""Chooses the unknowns of the lens by their significance: those that the images do not ask for stay zero.

Unknowns leave in groups, of which the later ones make sense only beside the earlier ones: the fifth power of the radial
distortion is not kept without the third.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from photogrammetry.adjustment.equations.unknowns import state_of
from photogrammetry.adjustment.solution.adjustment import Adjustment, adjust_once
from photogrammetry.geometry.camera_model import INTERIOR
from photogrammetry.network.model import Network

#: Tried from the first: each may leave if all its parameters are insignificant and nothing stays that builds on it.
_GROUPS: Final = (("b1", "b2"), ("a2",), ("a1",))
_BUILD_ON: Final = {"a1": "a2"}


def with_significant(network: Network) -> tuple[Network, list[str]]:
    """The network whose cameras estimate only distortions that are significant (5 %); the others are zero.

    Args:
        network: with start values of everything, free of gross errors.

    Returns:
        The network, and a line for each camera that does without something.

    Raises:
        NotSolvableError, NotConvergedError: as the adjustment.
    """
    left_out: dict[str, list[str]] = {}
    while True:
        a = adjust_once(network, state_of(network))
        found = [(i, group) for i in range(len(network.cameras)) if (group := _needless(a, i)) is not None]
        if not found:
            break
        cameras = list(network.cameras)
        for i, group in found:
            camera = cameras[i]
            interior = camera.interior.copy()
            interior[[INTERIOR.index(name) for name in group]] = 0.0
            stays = tuple(name for name in camera.estimate if name not in group)
            sigma = {name: value for name, value in camera.sigma.items() if name in stays}
            cameras[i] = replace(camera, estimate=stays, interior=interior, sigma=sigma)
            left_out.setdefault(camera.name, []).extend(group)
        network = replace(network, cameras=tuple(cameras))
    return network, [f"camera {name}: {', '.join(parts)} not significant, left out" for name, parts in left_out.items()]


def _needless(a: Adjustment, camera: int) -> Sequence[str] | None:
    """The first group that may leave; None: all that a camera estimates is significant."""
    parameters = {parameter.name: parameter for parameter in a.parameters(camera)[0]}
    for group in _GROUPS:
        there = [parameters[name] for name in group if name in parameters]
        built_on = any(_BUILD_ON.get(name) in parameters for name in group)
        if there and not built_on and all(parameter.insignificant for parameter in there):
            return group
    return None
