"""Exposure, gain and region of the cameras, changed while the rig runs and kept in the rig file on request."""

from dataclasses import replace
from functools import partial
from pathlib import Path

from rig.api.cameras.light import CameraLight, LightChange
from rig.events import Event, Level
from rig.phrase import phrase
from rig.settings.camera import CameraSettings
from rig.settings.light import camera_of, with_light, written
from service.regions import Regions, unfit
from service.rig_file import keep
from service.supervision.messages import ChangeCamera
from service.supervision.supervisor import Supervisor


class Lights:
    """Any thread may call any method.

    Args:
        supervisor: owns the rig.
        rig_file: where exposure and gain are kept.
        regions: of the cameras.
    """

    def __init__(self, supervisor: Supervisor, rig_file: Path, regions: Regions) -> None:
        self._supervisor, self._file, self._regions = supervisor, rig_file, regions
        self._kept = {camera.name: _light(camera) for camera in supervisor.rig.cameras}

    def view(self, name: str) -> CameraLight:
        """Exposure, gain and region of a camera.

        Raises:
            UnknownCameraError: the rig has no such camera.
        """
        camera = camera_of(self._supervisor.rig, name)
        exposure_us, gain_db = _light(camera)
        return CameraLight(
            camera=name,
            exposure_us=exposure_us,
            gain_db=gain_db,
            region=camera.region,
            limits=self._regions.limits(name),
            calibration=unfit(camera),
            saved=self._kept[name] == (exposure_us, gain_db) and self._regions.saved(camera),
        )

    def change(self, name: str, change: LightChange) -> CameraLight:
        """Change exposure, gain or region of a camera, and write them into the rig file if that is wished.

        Raises:
            UnknownCameraError: the rig has no such camera.
            BadInputError: a value is out of range, the camera or a check of arming refuses the region, or the rig file
                has become unreadable.
            StateForbidsError: a recording runs.
            StorageError: the rig file cannot be written; the camera has what was changed all the same.
        """
        with self._supervisor.changing:
            supervisor, in_use, before = self._supervisor, self._supervisor.now.in_use, self.view(name)
            rig = with_light(in_use.rig, name, change.values())
            exposure_us, gain_db = _light(camera_of(rig, name))
            new = replace(in_use, rig=rig, toml=written(in_use.toml, name, change.values()))
            lit = (exposure_us, gain_db) != (before.exposure_us, before.gain_db)
            if change.region is not None and change.region.region() != before.region:
                self._regions.change(name, change.region.region(), new)
            elif lit:
                supervisor.ask(partial(ChangeCamera, new=new, camera=name))
            if lit:
                said = phrase(
                    "event_light", "exposes for {exposure_us:g} us now, with a gain of {gain_db:g} dB",
                    exposure_us=exposure_us, gain_db=gain_db,
                )  # fmt: skip
                supervisor.hub.tell(Event.now(Level.INFO, name, said))
            if change.save:
                self._keep(name, exposure_us, gain_db)
                self._regions.keep(name)
            return self.view(name)

    def _keep(self, name: str, exposure_us: float, gain_db: float) -> None:
        """Write exposure and gain of a camera into the rig file."""
        text = "write exposure_us = {exposure_us:g} and gain_db = {gain_db:g} of {camera} into it"
        by_hand = phrase("keep_light", text, exposure_us=exposure_us, gain_db=gain_db, camera=name)
        keep(self._file, lambda text: written(text, name, {"exposure_us": exposure_us, "gain_db": gain_db}), by_hand)
        self._kept[name] = exposure_us, gain_db


def _light(camera: CameraSettings) -> tuple[float, float]:
    return camera.exposure_us, camera.gain_db
