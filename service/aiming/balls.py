"""Tells where the cameras should show the balls, by files, which it reads again when they have changed."""

import threading
from collections.abc import Callable
from pathlib import Path
from typing import Final

from rig.api.cameras.balls import CameraBalls
from rig.settings.camera import CameraSettings
from rig.settings.light import camera_of
from rig.settings.model import RigSettings

#: In the folder of the recordings: where the cameras showed the balls when they were oriented last.
ORIENTATION: Final = ".svev-orientation.json"


def ball_files(rig: RigSettings, folder: Path) -> list[Path]:
    """Last orientation, plan, survey and calibration, as far as the rig file names them; they need not be there.

    Args:
        rig: the rig.
        folder: of the recordings.
    """
    analysis = rig.analysis
    given = [] if analysis is None else [analysis.survey, analysis.calibration]
    return [file for file in (folder / ORIENTATION, rig.plan, *given) if file is not None]


class BallPlaces:
    """Any thread may call any method.

    Args:
        rig: gives the rig in use, of which only exposures, gains, regions and the rate change.
        folder: of the recordings.
    """

    def __init__(self, rig: Callable[[], RigSettings], folder: Path) -> None:
        self._rig, self._folder = rig, folder
        self._files = ball_files(rig(), folder)
        self._lock = threading.Lock()
        self._known: dict[CameraSettings, CameraBalls] = {}
        self._read: list[tuple[int, int] | None] = []

    def of(self, name: str) -> CameraBalls:
        """Where a camera should show the balls.

        Raises:
            UnknownCameraError: the rig has no such camera.
        """
        rig = self._rig()
        camera = camera_of(rig, name)
        # Imported here because photogrammetry and its libraries take memory and half a second to load.
        from service.aiming.sources import known_balls  # noqa: PLC0415

        with self._lock:
            if (now := [_state(file) for file in self._files]) != self._read:
                self._known, self._read = {}, now
            if camera not in self._known:
                self._known[camera] = known_balls(rig, camera, self._folder)
            return self._known[camera]


def _state(file: Path) -> tuple[int, int] | None:
    """A stamp of a file that changes when the file is written; None: there is no file."""
    try:
        found = file.stat()
    except OSError:
        return None
    return found.st_mtime_ns, found.st_ino
