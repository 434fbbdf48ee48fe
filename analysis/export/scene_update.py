"""The measured jumper as a scene in 3D for Foxglove: cameras, balls, stick model, ellipsoids (`foxglove.SceneUpdate`).

All in the frame "hill", the object system of the survey, m. Each entity replaces the one of the same id. Where the
cameras are in it `camera_frames` says (`foxglove.FrameTransforms`): the frame of a camera has its name, like that of
its image on `/camera/NAME` and of its calibration. As in both of these x is to the right, y down and z forward, so that
Foxglove draws the image into the scene.
"""

from functools import lru_cache
from typing import Final

import numpy as np
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.LinePrimitive_pb2 import LinePrimitive
from foxglove_schemas_protobuf.Quaternion_pb2 import Quaternion
from foxglove_schemas_protobuf.SceneEntity_pb2 import SceneEntity
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from foxglove_schemas_protobuf.Vector3_pb2 import Vector3
from scipy.spatial.transform import Rotation

from analysis.cameras.oriented_scene import OrientedScene
from analysis.export.places import SKI_LENGTH_M
from analysis.result.model import SmoothedState
from analysis.scene.camera_system import CameraSystem
from rig.arrays import Floats
from rig.clocks import NS_PER_S, UtcNs

FRAME: Final = "hill"
_BALL_M, _LINE_M = 0.19, 0.04
#: Ellipsoids have semi-axes of so many standard deviations; smaller ones than this, m, would not be seen.
_SIGMAS, _LEAST_M = 2.0, 0.03
#: Length of the drawn pyramid of a camera, m.
_CAMERA_M = 2.0
_WHITE, _RED, _GREEN, _BLUE = (1.0, 1.0, 1.0), (0.9, 0.2, 0.2), (0.2, 0.8, 0.3), (0.3, 0.6, 1.0)
_BODY: Final = (("P1", "P2"), ("P2", "P3"), ("P2", "P4"))
_SKIS: Final = (("right", "P3", _RED), ("left", "P4", _GREEN))

#: Signs that turn the axes of our cameras (y up, z backward) into those of an image (y down, z forward).
_OPTICAL: Final = np.array((1.0, -1.0, -1.0))
#: Quaternion, x, y, z, w, of what is not turned.
_UPRIGHT: Final = np.array((0.0, 0.0, 0.0, 1.0))

_Colour = tuple[float, float, float]


def scene_update(scene: OrientedScene, state: SmoothedState, time: UtcNs) -> bytes:
    """The scene at one pulse, encoded.

    Args:
        scene: cameras and balls.
        state: of the jumper.
        time: of the pulse.
    """
    update = SceneUpdate()
    hill = _entity(update, "hill", time)
    hill.MergeFrom(_hill(scene))
    jumper = _entity(update, "jumper", time)
    points = {name: point for name, point in state.points.items() if point is not None}
    for one, other in _BODY:
        if one in points and other in points:
            _strip(jumper, np.stack((points[one].xyz, points[other].xyz)), _WHITE)
    for side, binding, colour in _SKIS:
        ski = state.skis.get(side)
        if ski is not None and binding in points:
            ends = points[binding].xyz + np.array(((-1.0,), (1.0,))) * SKI_LENGTH_M / 2 * ski.direction
            _strip(jumper, ends, colour)
    for point in points.values():
        values, axes = np.linalg.eigh(point.covariance)
        turn = Rotation.from_matrix(axes * np.sign(np.linalg.det(axes))).as_quat()
        _ellipsoid(jumper, point.xyz, turn, np.maximum(2 * _SIGMAS * np.sqrt(np.maximum(values, 0)), _LEAST_M), _RED)
    return bytes(update.SerializeToString())


@lru_cache(maxsize=1)
def _hill(scene: OrientedScene) -> SceneEntity:
    """Cameras and balls, which stay the same from pulse to pulse."""
    hill = SceneEntity()
    for placed in scene.system.cameras.values():
        _strip(hill, _pyramid(placed.position, placed.rotation, placed.size / placed.camera.interior[0]), _BLUE)
    for ball in scene.balls.values():
        _ellipsoid(hill, ball.xyz, _UPRIGHT, np.full(3, _BALL_M), _WHITE)
    return hill


def camera_frames(system: CameraSystem, time: UtcNs) -> bytes:
    """Where the frames of the cameras are in the frame of the scene, encoded.

    Args:
        system: the cameras.
        time: from which on they stand so.
    """
    frames = FrameTransforms()
    for placed in system.cameras.values():
        frame = frames.transforms.add()
        frame.parent_frame_id, frame.child_frame_id = FRAME, placed.name
        frame.timestamp.seconds, frame.timestamp.nanos = divmod(int(time), NS_PER_S)
        _set(frame.translation, placed.position)
        _set(frame.rotation, Rotation.from_matrix(placed.rotation * _OPTICAL).as_quat())
    return bytes(frames.SerializeToString())


def _set(message: Vector3 | Quaternion, values: Floats) -> None:
    """Set x, y, z and, of a quaternion, w."""
    for name, value in zip("xyzw", values.tolist(), strict=False):
        setattr(message, name, value)


def _entity(update: SceneUpdate, name: str, time: UtcNs) -> SceneEntity:
    entity: SceneEntity = update.entities.add()
    entity.id, entity.frame_id = name, FRAME
    entity.timestamp.seconds, entity.timestamp.nanos = divmod(int(time), NS_PER_S)
    return entity


def _strip(entity: SceneEntity, places: Floats, colour: _Colour) -> None:
    line = entity.lines.add()
    line.type, line.thickness = LinePrimitive.Type.LINE_STRIP, _LINE_M
    line.pose.orientation.w = 1.0
    _set_colour(line, colour)
    for x, y, z in places.tolist():
        point = line.points.add()
        point.x, point.y, point.z = x, y, z


def _ellipsoid(entity: SceneEntity, centre: Floats, turn: Floats, size: Floats, colour: _Colour) -> None:
    """An ellipsoid with axes turned by a quaternion (4,), x, y, z, w, and whole lengths along them."""
    sphere = entity.spheres.add()
    _set(sphere.pose.position, centre)
    _set(sphere.pose.orientation, turn)
    sphere.size.x, sphere.size.y, sphere.size.z = (float(length) for length in size)
    _set_colour(sphere, colour)


def _set_colour(primitive: object, colour: _Colour) -> None:
    target = primitive.color  # type: ignore[attr-defined]
    target.r, target.g, target.b = colour
    target.a = 1.0


def _pyramid(centre: Floats, rotation: Floats, opening: Floats) -> Floats:
    """The edges of a camera's field of view as one line; `opening`: width and height over the principal distance."""
    signs = np.array(((-1, -1), (1, -1), (1, 1), (-1, 1)), float)
    corners = np.column_stack((signs * opening / 2, np.full(4, -1.0))) * _CAMERA_M
    a, b, c, d = corners @ rotation.T + centre
    return np.stack((centre, a, b, centre, c, d, centre, d, a, b, c))
