"""Keeps where the cameras showed the balls when they were oriented last, in a file of the recordings' folder.

The analysis process writes it, the service reads it: also next morning, when the service was started again and somebody
wants to see whether a camera was knocked in the night.
"""

from collections.abc import Mapping
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from pydantic import ValidationError

from analysis.cameras.oriented_scene import OrientedScene
from rig.api.cameras.balls import BallPlace
from rig.api.fields import Model
from rig.clocks import NS_PER_S, UtcNs
from rig.errors import StorageError
from rig.host.disk import replace_file
from rig.host.files import TEXT_MAX, read_whole
from rig.phrase import phrase
from rig.settings.camera import Region
from rig.settings.model import RigSettings
from service.aiming.balls import ORIENTATION
from service.aiming.places import Balls, of_system


class KeptCamera(Model):
    """Where a camera showed the balls.

    Attributes:
        given: identifies survey and interior orientation that it was oriented with.
        region: of the sensor.
        recording: in which it was oriented.
        oriented: when.
        balls: the places.
    """

    given: str
    region: Region
    recording: str
    oriented: datetime
    balls: tuple[BallPlace, ...]


class _Kept(Model):
    cameras: Mapping[str, KeptCamera]


def keep(scene: OrientedScene, recording: str, time: UtcNs, rig: RigSettings, folder: Path) -> None:
    """Keep where the cameras of a scene show the balls; what is kept of other cameras stays.

    Args:
        scene: oriented cameras and balls.
        recording: in which they were oriented.
        time: when.
        rig: the rig.
        folder: of the recordings.

    Raises:
        StorageError: the disk refuses.
    """
    regions = {camera.name: camera.region for camera in rig.cameras}
    names = tuple(scene.balls)
    xyz = np.array([scene.balls[name].xyz for name in names], float).reshape(-1, 3)
    covariance = np.array([np.diag(scene.balls[name].sigma ** 2) for name in names], float).reshape(-1, 3, 3)
    found = {
        camera: KeptCamera(
            given=scene.given,
            region=regions[camera],
            recording=recording,
            oriented=datetime.fromtimestamp(time / NS_PER_S, UTC),
            balls=of_system(
                scene.system, camera, Balls(names, xyz, covariance, [camera in scene.balls[n].images for n in names])
            ),
        )
        for camera in scene.system.names
        if camera in regions
    }
    path = folder / ORIENTATION
    try:
        replace_file(path, _Kept(cameras={**kept_in(folder), **found}).model_dump_json().encode(), links=False)
    except OSError as error:
        text = "{path}: cannot be written ({why}); make room on the disk, or the page shows old places of the balls"
        raise StorageError(
            phrase("why_balls_not_kept", text, path=str(path), why=error.strerror or str(error))
        ) from error


def kept_in(folder: Path) -> Mapping[str, KeptCamera]:
    """The kept orientation, by camera; empty if the file is missing or cannot be read: the next one will be whole."""
    try:
        return _Kept.model_validate_json(read_whole(folder / ORIENTATION, TEXT_MAX, links=False)).cameras
    except (OSError, ValidationError):
        return {}
