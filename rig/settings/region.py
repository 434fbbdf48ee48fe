"""The region of the sensor that a camera reads out, changed while the rig runs, and written into the rig file's text.

Interior orientations belong to the images with which a camera was calibrated. Of another region they do not hold: the
principal point is told from the middle of the image. So the region before the first change stays beside the new one,
as `calibrated_region`, until the camera has that region again or somebody who has calibrated it anew removes the key.
"""

from typing import Any

import tomlkit
from pydantic import Field

from rig.errors import BadInputError
from rig.phrase import Phrase, phrase
from rig.settings.camera import CameraSettings, Region
from rig.settings.editing import camera_table, editable
from rig.settings.light import camera_of
from rig.settings.model import RigSettings
from rig.settings.strict_toml import StrictModel, validate

_CALIBRATED = "calibrated_region"


class RegionLimits(StrictModel):
    """Which regions a camera takes, as it says itself, px."""

    width: int = Field(gt=0, description="columns of the whole sensor")
    height: int = Field(gt=0, description="rows of the whole sensor")
    step_x: int = Field(1, gt=0, description="`x` is a multiple of it")
    step_y: int = Field(1, gt=0, description="`y` is a multiple of it")
    step_width: int = Field(1, gt=0, description="`width` is `least_width` and a multiple of it")
    step_height: int = Field(1, gt=0, description="`height` is `least_height` and a multiple of it")
    least_width: int = Field(1, gt=0)
    least_height: int = Field(1, gt=0)

    def check(self, camera: str, region: Region) -> None:
        """Check a region.

        Args:
            camera: its name.
            region: of its sensor.

        Raises:
            BadInputError: the camera does not take it; the message says what it takes.
        """
        fits = region.x + region.width <= self.width and region.y + region.height <= self.height
        on_steps = (region.x % self.step_x, region.y % self.step_y) == (0, 0)
        more = region.width - self.least_width, region.height - self.least_height
        sized = min(more) >= 0 and (more[0] % self.step_width, more[1] % self.step_height) == (0, 0)
        if not (fits and on_steps and sized):
            raise BadInputError(
                f"camera {camera} has {self.width} x {self.height} px, and no region of {named(region)}: x goes in "
                f"steps of {self.step_x}, y of {self.step_y}, width from {self.least_width} in steps of "
                f"{self.step_width}, height from {self.least_height} in steps of {self.step_height}"
            )


def named(region: Region) -> Phrase:
    """A region in words."""
    x, y, width, height = region.x, region.y, region.width, region.height
    return phrase("region_named", "{width} x {height} px from {x}, {y}", x=x, y=y, width=width, height=height)


def calibration_unfit(camera: CameraSettings) -> Phrase | None:
    """Why no calibration fits a camera: it was calibrated with another region; None: that is not so."""
    if camera.calibrated_region is None:
        return None
    text = "calibration no longer fits: {camera} was calibrated with {calibrated}, and reads out {region}"
    calibrated, region = named(camera.calibrated_region), named(camera.region)
    return phrase("calibration_unfit", text, camera=camera.name, calibrated=calibrated, region=region)


def with_region(rig: RigSettings, name: str, region: Region) -> RigSettings:
    """The rig with another region of a camera.

    Raises:
        UnknownCameraError: the rig has no such camera.
        BadInputError: the camera's frames are no part of a sensor, or the rig's settings do not go with the region.
    """
    camera = camera_of(rig, name)
    if camera.backend in {"sim", "replay"}:
        raise BadInputError(
            f'the frames of camera {name} are no part of a larger image (backend "{camera.backend}"): its region stays'
        )
    content = rig.model_dump(exclude_unset=True)
    (changed,) = (each for each in content["cameras"] if each["name"] == name)
    changed["region"] = region.model_dump()
    calibrated = camera.calibrated_region or camera.region
    changed.pop(_CALIBRATED, None)
    if calibrated != region:
        changed[_CALIBRATED] = calibrated.model_dump()
    return validate(RigSettings, content, "the rig with this region")


def written_region(text: str, name: str, region: Region, calibrated: Region | None) -> str:
    """The text of a rig file with another region of a camera; everything else in it stays as it is.

    Args:
        text: of the rig file (TOML).
        name: of the camera.
        region: of its sensor.
        calibrated: the region with which it was calibrated, if that is another one.

    Raises:
        BadInputError: the text is not TOML, or has no such camera.
    """
    document = editable(text)
    camera = camera_table(document, name)
    _put(camera, "region", region)
    if calibrated is None:
        camera.pop(_CALIBRATED, None)
    else:
        _put(camera, _CALIBRATED, calibrated)
    return tomlkit.dumps(document)


def _put(camera: dict[str, Any], key: str, region: Region) -> None:
    """Write a region; a table that is there keeps its form."""
    if not isinstance(camera.get(key), dict):
        camera[key] = tomlkit.inline_table()
    camera[key].update(region.model_dump())
