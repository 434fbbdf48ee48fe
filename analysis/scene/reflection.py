"""The other pose of balls that nearly lie in a plane: it shows them nearly alike, under the same names.

A single image may not decide between both. Then its pose is a start value only, and what follows from it alone, such as
tie balls, is not looked for; the adjustment of all images decides, or says that nothing does
(`photogrammetry.procedures.minima`).
"""

from dataclasses import replace

import numpy as np

from analysis.scene.naming import MODEL_SIGMA, Naming, Spots
from analysis.scene.single_pose import Matched, SinglePose, fit_poses, predict
from analysis.scene.survey import KnownPoints
from photogrammetry.geometry.camera_model import undistort
from photogrammetry.geometry.ideal_camera import IdealCamera
from photogrammetry.network.model import Camera
from photogrammetry.procedures.minima import WORSE
from photogrammetry.start_values.resection import second_pose
from rig.errors import BadInputError


def with_better_pose(naming: Naming, camera: Camera, spots: Spots, known: KnownPoints) -> Naming:
    """The naming with the better one of its two poses; `doubtful` where the balls do not decide between them.

    Args:
        naming: of one image.
        camera: of the image.
        spots: its detections.
        known: the surveyed balls.
    """
    xyz, xy = known.xyz[naming.points], spots.xy[naming.spots]
    ideal = undistort(camera.lens(), xy)
    here = IdealCamera(float(camera.interior[0]), naming.pose.position, naming.pose.rotation)
    if not np.isfinite(ideal).all() or not here.in_front(xyz).all():
        return naming
    try:
        reflected = second_pose(here, xyz, ideal)
    except BadInputError:
        return naming  # balls on a line: their pose is refused for that
    if reflected is None:
        return naming
    spread = spots.covariance[naming.spots] + MODEL_SIGMA**2 * np.eye(2)
    matched = Matched(xyz, known.covariance[naming.points], xy, spread)
    start = SinglePose(reflected.camera.X0, reflected.camera.R, np.zeros((6, 6)))
    other = fit_poses(camera.lens(), [start], [matched])[0]
    if other is None:
        return naming
    difference = _square_sum(other, camera, matched) - _square_sum(naming.pose, camera, matched)
    better = naming if difference >= 0.0 else replace(naming, pose=other)
    return replace(better, doubtful=bool(abs(difference) < WORSE))


def _square_sum(pose: SinglePose, camera: Camera, matched: Matched) -> float:
    xy, from_point, _ = predict(camera.lens(), pose, matched.xyz, matched.xyz_covariance)
    off = matched.xy - xy
    squares = np.einsum("ni,nij,nj->n", off, np.linalg.inv(from_point + matched.xy_covariance), off)
    return float(np.where(np.isfinite(squares), squares, np.inf).sum())
