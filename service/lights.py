"""Exposure and gain of the cameras, changed while the rig runs and kept in the rig file when somebody wishes that."""

from functools import partial
from pathlib import Path
from typing import Final

from rig.api.cameras.light import CameraLight, LightChange
from rig.events import Event, Level
from rig.phrase import Phrase, phrase
from rig.settings.light import camera_of, with_light, written
from rig.settings.model import CameraSettings
from service.rig_file import keep
from service.supervision.commands import at_once
from service.supervision.supervisor import Supervisor

_SOON_S: Final = 10.0


class Lights:
    """Any thread may call any method.

    Args:
        supervisor: owns the rig.
        rig_file: where exposure and gain are kept.
    """

    def __init__(self, supervisor: Supervisor, rig_file: Path) -> None:
        self._supervisor, self._file = supervisor, rig_file
        self._kept = {camera.name: _light(camera) for camera in supervisor.rig.cameras}

    def view(self, name: str) -> CameraLight:
        """Exposure and gain of a camera.

        Raises:
            UnknownCameraError: the rig has no such camera.
        """
        camera = camera_of(self._supervisor.rig, name)
        exposure_us, gain_db = _light(camera)
        saved = self._kept[name] == (exposure_us, gain_db)
        return CameraLight(camera=name, exposure_us=exposure_us, gain_db=gain_db, saved=saved)

    def change(self, name: str, change: LightChange) -> CameraLight:
        """Change exposure or gain of a camera, and write both into the rig file if that is wished.

        Raises:
            UnknownCameraError: the rig has no such camera.
            BadInputError: a value is out of range, or the rig file has become unreadable.
            StateForbidsError: a recording runs.
            StorageError: the rig file cannot be written; the camera has its other exposure or gain all the same.
        """
        with self._supervisor.changing:
            supervisor, before = self._supervisor, self.view(name)
            rig = with_light(supervisor.rig, name, change.values())
            exposure_us, gain_db = _light(camera_of(rig, name))
            if (exposure_us, gain_db) != (before.exposure_us, before.gain_db):
                text = written(supervisor.rig_toml, name, change.values())
                supervisor.commands.ask(at_once(partial(supervisor.change_camera, rig, text, name)), _SOON_S)
                said = phrase(
                    "event_light", "exposes for {exposure_us:g} us now, with a gain of {gain_db:g} dB",
                    exposure_us=exposure_us, gain_db=gain_db,
                )  # fmt: skip
                supervisor.hub.tell(Event.now(Level.INFO, name, said))
            if change.save:
                self._keep(name, exposure_us, gain_db)
            return self.view(name)

    def _keep(self, name: str, exposure_us: float, gain_db: float) -> None:
        """Write exposure and gain of a camera into the rig file."""

        def not_kept(why: str) -> Phrase:
            text = (
                "{path}: cannot be written ({why}); write exposure_us = {exposure_us:g} and gain_db = {gain_db:g} of "
                "{camera} into it, or a restart of the service loses them"
            )
            return phrase(
                "why_light_not_kept", text,
                path=str(self._file), why=why, exposure_us=exposure_us, gain_db=gain_db, camera=name,
            )  # fmt: skip

        keep(self._file, lambda text: written(text, name, {"exposure_us": exposure_us, "gain_db": gain_db}), not_kept)
        self._kept[name] = exposure_us, gain_db


def _light(camera: CameraSettings) -> tuple[float, float]:
    return camera.exposure_us, camera.gain_db
