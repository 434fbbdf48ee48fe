"""The tracks in space, for programs whose files hold them beside the image points."""

from collections.abc import Sequence

import numpy as np

from analysis.digitizing.exchange.tracks import Tracks
from analysis.digitizing.geometry.space import Ray, intersected, space_points
from analysis.digitizing.marks.effective import covariance_of
from analysis.digitizing.marks.journal import Entered
from analysis.scene.camera_system import CameraSystem
from rig.arrays import Floats


def all_oriented(system: CameraSystem | None, cameras: Sequence[str]) -> CameraSystem | None:
    """The oriented cameras in the order of the log; None if one of them is not oriented."""
    return system.only(cameras) if system is not None and set(cameras) <= set(system.names) else None


def xyz_of(tracks: Tracks, system: CameraSystem | None) -> tuple[Floats, Floats]:
    """Places (f, t, 3) of the tracks, m, and root mean squares of their residuals (f, t), px; NaN where unknown."""
    frames, names = tracks.xy.shape[:2]
    xyz, residuals = np.full((frames, names, 3), np.nan), np.full((frames, names), np.nan)
    if system is None:
        return xyz, residuals
    covariance = covariance_of(Entered())
    seen = np.asarray(np.isfinite(tracks.xy).all(-1))
    for frame in np.flatnonzero((seen.sum(-1) > 1).any(-1)).tolist():
        rays = {
            name: {
                camera: Ray(tracks.xy[frame, track, place], covariance)
                for place, camera in enumerate(tracks.cameras)
                if seen[frame, track, place]
            }
            for track, name in enumerate(tracks.names)
            if seen[frame, track].sum() > 1
        }
        found = space_points(system, intersected(system, rays))
        for track, name in enumerate(tracks.names):
            if name in found and (point := found[name]).X is not None:
                xyz[frame, track] = point.X
                residuals[frame, track] = np.sqrt(np.mean(np.square(list(point.residuals.values()))))
    return xyz, residuals
