"""Shapes as meshes: everything is a skin over a row of closed rings."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from rig.arrays import Floats

_AROUND: Final = 24  # corners of a round ring


@dataclass(frozen=True, slots=True)
class Mesh:
    """Corners and faces.

    Attributes:
        corners: m, shape (n, 3).
        faces: indices of the corners of each face.
        smooth: shaded as a smooth surface.
        marked: indices of the faces that have the second material.
    """

    corners: Floats
    faces: list[tuple[int, ...]]
    smooth: bool = True
    marked: list[int] = field(default_factory=list)

    def plain(self) -> dict[str, Any]:
        """As data for JSON."""
        return {
            "corners": np.round(self.corners, 5).tolist(),
            "faces": self.faces,
            "smooth": self.smooth,
            "marked": self.marked,
        }


def skin(rings: Floats, smooth: bool = True, marked: Sequence[int] = ()) -> Mesh:
    """A closed skin over rings of corners, shape (m, k, 3), each anticlockwise as seen from the last one's side.

    Args:
        rings: the rings.
        smooth: see `Mesh`.
        marked: numbers of the strips between two rings that have the second material.
    """
    count, around = rings.shape[:2]
    faces: list[tuple[int, ...]] = [tuple(range(around))[::-1]]
    second = []
    for ring in range(count - 1):
        for k in range(around):
            a, b = ring * around + k, ring * around + (k + 1) % around
            if ring in marked:
                second.append(len(faces))
            faces.append((a, b, b + around, a + around))
    faces.append(tuple(range((count - 1) * around, count * around)))
    return Mesh(rings.reshape(-1, 3), faces, smooth, second)


def loft(profile: Sequence[tuple[float, float, float]]) -> Mesh:
    """A body along z.

    Args:
        profile: height, half width along x, half width along y of each ring, m.
    """
    turn = np.arange(_AROUND) * 2 * math.pi / _AROUND
    rings = [np.stack((a * np.cos(turn), b * np.sin(turn), np.full(_AROUND, z)), axis=1) for z, a, b in profile]
    return skin(np.array(rings))


def ellipsoid(x: float, y: float, z: float, rings: int = 16) -> Mesh:
    """An ellipsoid about 0 with these half axes, m."""
    turns = [math.pi * (i + 0.02) / (rings + 0.04 - 1) for i in range(rings)]
    return loft([(-z * math.cos(t), x * math.sin(t), y * math.sin(t)) for t in turns])


def limb(length: float, thick: Sequence[float], deep: float = 1.0) -> Mesh:
    """A limb with round ends from 0 to `length` along z.

    Args:
        length: m.
        thick: its radii at places evenly spread from end to end, m.
        deep: its half widths along y, in those along x.
    """
    ends = np.linspace(0.05, math.pi / 2, 6)
    low = [(-thick[0] * math.cos(t), thick[0] * math.sin(t)) for t in ends[:-1]]
    places = np.linspace(0, 1, 4 * (len(thick) - 1) + 1)
    middle = list(zip(places * length, np.interp(places, np.linspace(0, 1, len(thick)), thick), strict=True))
    high = [(length + thick[-1] * math.cos(t), thick[-1] * math.sin(t)) for t in ends[::-1][1:]]
    return loft([(z, r, r * deep) for z, r in (*low, *middle, *high)])


def disc(radius: float, thick: float) -> Mesh:
    """A plate about 0, with its axis along z; m."""
    half = thick / 2
    rim = loft([(-half, radius, radius), (half, radius, radius)])
    return Mesh(rim.corners, rim.faces, smooth=False)


def box(low: Sequence[float], high: Sequence[float]) -> Mesh:
    """A box between two corners, m."""
    (x, y, z), (X, Y, Z) = low, high  # noqa: N806
    ring = [(x, y), (X, y), (X, Y), (x, Y)]
    return skin(np.array([[(a, b, c) for a, b in ring] for c in (z, Z)]), smooth=False)


def arc(radius: float, half_height: float) -> Mesh:
    """A half cylinder about the y axis, open towards -z; m."""
    turn = np.linspace(-math.pi / 2, math.pi / 2, _AROUND)
    low, high = (
        np.stack((radius * np.sin(turn), np.full(_AROUND, y), radius * np.cos(turn)), axis=1)
        for y in (-half_height, half_height)
    )
    faces: list[tuple[int, ...]] = [(k, k + 1, k + 1 + _AROUND, k + _AROUND) for k in range(_AROUND - 1)]
    return Mesh(np.concatenate((low, high)), faces)


def grid(x: Floats, y: Floats, z: Floats) -> Mesh:
    """A surface over a grid.

    Args:
        x: shape (m,), m.
        y: shape (n,), m.
        z: its heights, shape (m, n), m.
    """
    X, Y = np.meshgrid(x, y, indexing="ij")  # noqa: N806
    m, n = z.shape
    faces: list[tuple[int, ...]] = [
        (i * n + j, (i + 1) * n + j, (i + 1) * n + j + 1, i * n + j + 1) for i in range(m - 1) for j in range(n - 1)
    ]
    return Mesh(np.stack((X, Y, z), axis=-1).reshape(-1, 3), faces)
