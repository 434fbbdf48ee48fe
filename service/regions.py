"""The regions of the sensors that cameras read out, changed while the rig runs and kept in the rig file on request."""

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Final

from capture.iidc.bandwidth import is_fixed_format
from rig.api.statement import Level as StatementLevel
from rig.api.statement import Statement
from rig.events import Event, Level
from rig.phrase import phrase
from rig.settings.camera import CameraSettings, Region
from rig.settings.light import camera_of
from rig.settings.region import RegionLimits, calibration_unfit, named, with_region, written_region
from service.processes.backends import check_backends
from service.processes.memory import check_memory
from service.rig_file import keep
from service.supervision.messages import ChangeRegion
from service.supervision.situation import RigInUse
from service.supervision.supervisor import Supervisor

#: Cameras have 20 s to answer at arming, and the first triplets 10 s more.
_TRIAL_ENDS_S: Final = 45.0


class Regions:
    """Any thread may call any method.

    Args:
        supervisor: owns the rig.
        rig_file: where regions are kept.
        preroll_s: length of the pre-roll, whose memory grows with the regions.
    """

    def __init__(self, supervisor: Supervisor, rig_file: Path, preroll_s: float) -> None:
        self._supervisor, self._file, self._preroll_s = supervisor, rig_file, preroll_s
        self._kept = {camera.name: camera.region for camera in supervisor.rig.cameras}

    def saved(self, camera: CameraSettings) -> bool:
        """Whether the rig file says the same."""
        return self._kept[camera.name] == camera.region

    def limits(self, name: str) -> RegionLimits | None:
        """Which regions a camera takes; None: it was not connected yet, or does not say."""
        return self._supervisor.now.heard.limits.get(name)

    def change(self, name: str, region: Region, also: RigInUse) -> None:
        """Read out another region of a camera's sensor; returns when the rig is armed with it, or at once if it is not.

        The caller holds `Supervisor.changing`.

        Args:
            name: of the camera.
            region: another one than now.
            also: the rig in use with what else is to be changed at once.

        Raises:
            UnknownCameraError: the rig has no such camera.
            BadInputError: the camera does not take it, the rig does not go with it, or a check of arming fails, and
                then the region before is in use again.
            StateForbidsError: a recording runs, or the rig is being armed or disarmed.
        """
        supervisor = self._supervisor
        rig = with_region(also.rig, name, region)
        camera = camera_of(rig, name)
        if (limits := self.limits(name)) is not None and not (camera.backend == "iidc" and is_fixed_format(camera)):
            limits.check(name, region)
        check_backends(rig)
        check_memory(rig, self._preroll_s)
        new = replace(also, rig=rig, toml=written_region(also.toml, name, region, camera.calibrated_region))
        said = phrase("event_region", "reads out {region} now", region=named(region))
        supervisor.change(partial(ChangeRegion, new=new, camera=name), name, said, _TRIAL_ENDS_S)
        if (why := calibration_unfit(camera)) is not None:
            supervisor.hub.tell(Event.now(Level.WARNING, name, why))

    def keep(self, name: str) -> None:
        """Write the region of a camera into the rig file, if that says another one.

        Raises:
            BadInputError: the rig file has become unreadable.
            StorageError: it cannot be written.
        """
        camera = camera_of(self._supervisor.rig, name)
        if self.saved(camera):
            return
        table = ", ".join(f"{key} = {value}" for key, value in camera.region.model_dump().items())
        text = "write region = {region} of {camera} into it"
        by_hand = phrase("keep_region", text, region=f"{{ {table} }}", camera=name)
        calibrated = camera.calibrated_region
        keep(self._file, lambda text: written_region(text, name, camera.region, calibrated), by_hand)
        self._kept[name] = camera.region


def unfit(camera: CameraSettings) -> Statement | None:
    """Says that a camera was calibrated with another region; None: that is not so."""
    if (said := calibration_unfit(camera)) is None:
        return None
    advice = "give that region back, or calibrate with this one and remove calibrated_region from the rig file"
    return Statement(level=StatementLevel.WARNING, code=said.code, text=said.text, advice=advice, values=said.values)
