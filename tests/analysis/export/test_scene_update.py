"""The scene for Foxglove: decoded as any program would, its frames and the pixels of the cameras agree."""

import numpy as np
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from scipy.spatial.transform import Rotation

from analysis.export.camera_calibration import plumb_bob, project
from analysis.export.scene_update import FRAME, camera_frames
from photogrammetry.geometry.camera_model import INTERIOR
from photogrammetry.network.calibration_file import CalibratedCamera
from rig.clocks import UtcNs
from tests.analysis.simulated import SIZE, true_cameras

TIME = UtcNs(1_795_216_434_399_239_000)


def test_a_point_of_the_scene_lies_where_the_calibration_projects_it_into_the_image() -> None:
    system = true_cameras()
    frames = FrameTransforms.FromString(camera_frames(system, TIME))
    assert [frame.child_frame_id for frame in frames.transforms] == list(system.names)
    place = np.array((5.0, 0.3, 0.5))
    for frame in frames.transforms:
        assert frame.parent_frame_id == FRAME
        assert frame.timestamp.ToNanoseconds() == TIME
        moved = np.array((frame.translation.x, frame.translation.y, frame.translation.z))
        q = frame.rotation
        in_camera = Rotation.from_quat((q.x, q.y, q.z, q.w)).inv().apply(place - moved)
        placed = system[frame.child_frame_id]
        assert in_camera[2] > 10, "the jumper is before the camera"
        interior = dict(zip(INTERIOR, placed.camera.interior.tolist(), strict=True))
        calibrated = CalibratedCamera(**interior, r0=0.0, distortion="projected")
        seen = project(plumb_bob(calibrated, SIZE), in_camera[None])[0]
        assert np.allclose(seen, placed.project(place), atol=1e-6)
