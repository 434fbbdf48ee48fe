"""Exposure, gain and region of a camera, as the REST API changes and tells them."""

from typing import Annotated

from pydantic import Field, StrictBool

from rig.api.fields import WHOLE, Model
from rig.api.statement import Statement
from rig.settings.camera import Region
from rig.settings.region import RegionLimits

_Place = Annotated[int, Field(ge=0, le=16384), WHOLE]
_Size = Annotated[int, Field(gt=0, le=16384), WHOLE]


class WantedRegion(Model):
    """The part of the sensor that is to be read out, px."""

    x: _Place = Field(description="first column")
    y: _Place = Field(description="first row")
    width: _Size
    height: _Size

    def region(self) -> Region:
        """As the rig file has it."""
        return Region(x=self.x, y=self.y, width=self.width, height=self.height)


class LightChange(Model):
    """What is to be changed; what is left out stays as it is."""

    exposure_us: Annotated[float, Field(gt=0, le=1_000_000, strict=True)] | None = Field(
        None, description="exposure time, microseconds; shorter than from pulse to pulse", examples=[1500]
    )
    gain_db: Annotated[float, Field(ge=0, le=60, strict=True)] | None = Field(
        None, description="gain, decibels", examples=[3]
    )
    region: WantedRegion | None = Field(
        None, description="part of the sensor; an armed rig is armed anew with it, and the answer comes when it is"
    )
    save: StrictBool = Field(
        False, description="write exposure, gain and region of this camera into the rig file as well"
    )

    def values(self) -> dict[str, float]:
        """Exposure and gain that are to be changed, by the keys of the rig file."""
        return {key: value for key in ("exposure_us", "gain_db") if (value := getattr(self, key)) is not None}


class CameraLight(Model):
    """Exposure, gain and region of a camera."""

    camera: str
    exposure_us: float = Field(description="exposure time, microseconds")
    gain_db: float = Field(description="gain, decibels")
    region: Region = Field(description="the part of the sensor that is read out, px")
    limits: RegionLimits | None = Field(
        None, description="which regions the camera takes; null: it was not connected yet, or does not say"
    )
    calibration: Statement | None = Field(
        None, description="says that calibrations no longer fit, because they were made with another region"
    )
    saved: bool = Field(description="whether the rig file says the same, so that a restart keeps it")
