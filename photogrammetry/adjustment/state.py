"""Values of everything that an adjustment may change: interior orientations, poses, points."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from photogrammetry.network import Network
from rig.errors import BadInputError

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """Values in the network's order.

    Attributes:
        interior: (cameras, 10).
        position: (images, 3).
        rotation: (images, 3, 3).
        xyz: (points, 3).
    """

    interior: Floats
    position: Floats
    rotation: Floats
    xyz: Floats


def state_of(network: Network) -> State:
    """The values a network brings.

    Raises:
        BadInputError: a pose or point has none; the message names it.
    """
    for image in network.images:
        if image.position is None or image.rotation is None:
            raise BadInputError(f'images.{image.name}: no start values; give "X0" and "R"')
    for point in network.points:
        if point.xyz is None:
            raise BadInputError(f'points.{point.name}: no start values; give "X"')
    return State(
        np.array([camera.interior for camera in network.cameras], dtype=float).reshape(-1, 10),
        np.array([image.position for image in network.images], dtype=float).reshape(-1, 3),
        np.array([image.rotation for image in network.images], dtype=float).reshape(-1, 3, 3),
        np.array([point.xyz for point in network.points], dtype=float).reshape(-1, 3),
    )


def with_state(network: Network, state: State) -> Network:
    """The network with the values of a state, for instance as start values of another adjustment."""
    return replace(
        network,
        cameras=tuple(replace(c, interior=v) for c, v in zip(network.cameras, state.interior, strict=True)),
        images=tuple(
            replace(image, position=x, rotation=r)
            for image, x, r in zip(network.images, state.position, state.rotation, strict=True)
        ),
        points=tuple(replace(point, xyz=x) for point, x in zip(network.points, state.xyz, strict=True)),
    )
