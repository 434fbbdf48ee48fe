"""Exposure and gain of a camera, as the REST API changes and tells them."""

from typing import Annotated

from pydantic import Field, StrictBool

from rig.api.fields import Model


class LightChange(Model):
    """What is to be changed; what is left out stays as it is."""

    exposure_us: Annotated[float, Field(gt=0, le=1_000_000, strict=True)] | None = Field(
        None, description="exposure time, microseconds; shorter than from pulse to pulse", examples=[1500]
    )
    gain_db: Annotated[float, Field(ge=0, le=60, strict=True)] | None = Field(
        None, description="gain, decibels", examples=[3]
    )
    save: StrictBool = Field(False, description="write exposure and gain of this camera into the rig file as well")

    def values(self) -> dict[str, float]:
        """What is to be changed, by the keys of the rig file."""
        return {key: value for key in ("exposure_us", "gain_db") if (value := getattr(self, key)) is not None}


class CameraLight(Model):
    """Exposure and gain of a camera."""

    camera: str
    exposure_us: float = Field(description="exposure time, microseconds")
    gain_db: float = Field(description="gain, decibels")
    saved: bool = Field(description="whether the rig file says the same, so that a restart keeps it")
