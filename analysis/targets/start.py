"""Start values from pictures of targets: principal distance, poses, and places of corners, as far as OpenCV can tell.

Each target is a small plane of known shape, the board a large one. The picture with most corners begins the frame; a
picture that shows enough placed corners is resected, then its other targets are placed by their own pose. All of it is
only where the adjustment begins: no assumption about shape or size of the targets goes into the result.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import ArrayLike

from analysis.targets.detection import Sight
from analysis.targets.pattern import CORNERS, Layout, target_of
from rig.arrays import Floats

_CORNERS_OF_RESECTION: Final = 6  # corners of a resection
_CORNERS_OF_PLANE: Final = 4  # corners of a plane's pose
_USUAL_DISTANCE: Final = 1.2  # principal distance over the picture's width, where the pictures tell nothing
_LIKELY: Final = (0.4, 8.0)  # the same, of lenses that this is made for
_FLIP: Final = np.diag([1.0, -1.0, -1.0])  # OpenCV's camera looks along +z with y down, ours along -z with y up


@dataclass(frozen=True, slots=True, eq=False)
class Start:
    """Start values.

    Attributes:
        c: principal distance of each camera, px.
        poses: by number of the picture, X0 (3,) and R (3, 3) as the network has them; not those without a start.
        places: by name of the corner, (3,) mm.
    """

    c: Mapping[str, float]
    poses: Mapping[int, tuple[Floats, Floats]]
    places: Mapping[str, Floats]


@dataclass(frozen=True, slots=True, eq=False)
class _Plane:
    """Corners of a target in a picture: names, their places on the target (n, 3) mm, and where they are (n, 2) px."""

    names: list[str]
    flat: Floats
    seen: Floats


def start_values(sights: Sequence[tuple[str, Sight]], layout: Layout) -> Start:
    """Start values of pictures, each with the name of its camera."""
    planes = [_planes(sight, layout) for _, sight in sights]
    c = {camera: _principal_distance(camera, sights, planes) for camera, _ in sights}
    matrices = [_matrix(c[camera], sight.size) for camera, sight in sights]
    places: dict[str, Floats] = {}
    poses: dict[int, tuple[Floats, Floats]] = {}  # rotation and translation as OpenCV has them
    waiting = set(range(len(sights)))
    while waiting:
        counts = {k: sum(name in places for name in sights[k][1].corners) for k in waiting}
        if not places:
            counts = {k: len(sights[k][1].corners) for k in waiting}
        k = max(waiting, key=lambda one: (counts[one], -one))
        waiting.remove(k)
        if not places and planes[k]:
            largest = max(planes[k], key=lambda plane: _extent(plane.seen))
            places.update(zip(largest.names, largest.flat, strict=True))
            pose = _plane_pose(largest, matrices[k])
        elif counts[k] >= _CORNERS_OF_RESECTION:
            pose = _resected(sights[k][1], places, matrices[k])
        else:
            continue
        if pose is None:
            continue
        poses[k] = pose
        for plane in planes[k]:
            if any(name in places for name in plane.names):
                continue
            own = _plane_pose(plane, matrices[k])
            if own is not None:
                in_camera = plane.flat @ own[0].T + own[1]
                places.update(zip(plane.names, (in_camera - pose[1]) @ pose[0], strict=True))
    ours = {k: (-rotation.T @ shift, rotation.T @ _FLIP) for k, (rotation, shift) in poses.items()}
    return Start(c, ours, places)


def _planes(sight: Sight, layout: Layout) -> list[_Plane]:
    """The targets of a picture that have enough measured corners; the board is one of them."""
    board = [name for name in sight.corners if target_of(name) == "board"]
    found = [(board, np.array([layout.board_place(name) for name in board], dtype=float))]
    for code in sight.targets:
        names = layout.corners(code)
        if target_of(names[0] or "B") != "board":
            there = [i for i, name in enumerate(names) if name in sight.corners]
            flat = np.column_stack((CORNERS * (1.0, -1.0), np.zeros(4))) * layout.side_mm(code)
            found.append(([str(names[i]) for i in there], flat[there]))
    return [
        _Plane(names, flat, np.array([(sight.corners[name].x, sight.corners[name].y) for name in names]))
        for names, flat in found
        if len(names) >= _CORNERS_OF_PLANE
    ]


def _extent(seen: Floats) -> float:
    return float(np.linalg.norm(np.ptp(seen, axis=0)))


def _principal_distance(camera: str, sights: Sequence[tuple[str, Sight]], planes: Sequence[list[_Plane]]) -> float:
    """The principal distance (px) from the perspective of the largest planes (Zhang 2000), or a usual one."""
    mine = [(sight.size, plane) for (name, sight), each in zip(sights, planes, strict=True) if name == camera
            for plane in each]  # fmt: skip
    if not mine:
        size = next(sight.size for name, sight in sights if name == camera)
        return _USUAL_DISTANCE * size[0]
    largest = max(_extent(plane.seen) for _, plane in mine)
    some = [plane for _, plane in mine if _extent(plane.seen) > 0.5 * largest]
    (width, height), _ = mine[0]
    matrix = cv2.initCameraMatrix2D(
        [plane.flat.astype(np.float32) for plane in some],
        [plane.seen.astype(np.float32)[:, None] for plane in some],
        (width, height),
        1.0,
    )
    c = float(matrix[0, 0])
    return c if np.isfinite(c) and _LIKELY[0] < c / width < _LIKELY[1] else _USUAL_DISTANCE * width


def _matrix(c: float, size: tuple[int, int]) -> Floats:
    return np.array([[c, 0.0, (size[0] - 1) / 2.0], [0.0, c, (size[1] - 1) / 2.0], [0.0, 0.0, 1.0]])


def _plane_pose(plane: _Plane, matrix: Floats) -> tuple[Floats, Floats] | None:
    """Rotation and translation of a plane, the better of the two that its perspective allows, seen from its front."""
    found, rotations, shifts, _ = cv2.solvePnPGeneric(
        plane.flat, plane.seen[:, None], matrix, None, flags=cv2.SOLVEPNP_IPPE
    )
    poses = [_pose(*each) for each in zip(rotations, shifts, strict=True)] if found else []
    if not poses or poses[0][0][:, 2] @ poses[0][1] < 0.0:
        return poses[0] if poses else None
    # a plane seen straight from its front has no perspective, which that method needs
    found, rotation, shift = cv2.solvePnP(plane.flat, plane.seen[:, None], matrix, None, flags=cv2.SOLVEPNP_ITERATIVE)
    return _pose(rotation, shift) if found else None


def _resected(sight: Sight, places: Mapping[str, Floats], matrix: Floats) -> tuple[Floats, Floats] | None:
    """Rotation and translation from placed corners."""
    names = [name for name in sight.corners if name in places]
    space = np.array([places[name] for name in names])
    seen = np.array([(sight.corners[name].x, sight.corners[name].y) for name in names])
    found, rotation, shift = cv2.solvePnP(space, seen[:, None], matrix, None, flags=cv2.SOLVEPNP_SQPNP)
    return _pose(rotation, shift) if found else None


def _pose(rotation: ArrayLike, shift: ArrayLike) -> tuple[Floats, Floats]:
    """Rotation (3, 3) and translation (3,) of what OpenCV answers."""
    return np.array(cv2.Rodrigues(np.asarray(rotation))[0], dtype=float), np.array(shift, dtype=float).ravel()
