"""The settings of a camera of the rig."""

import re
from typing import Final, Literal

from pydantic import Field, model_validator

from rig.images.pixels import FORMATS, PixelFormat, PixelFormatName
from rig.settings.strict_toml import StrictModel

Backend = Literal["aravis", "iidc", "sim", "replay"]
#: The back ends whose cameras can be told to expose.
COMMANDED: Final[frozenset[Backend]] = frozenset({"aravis", "iidc"})

#: Grey pixels of 8 bits, or of 16 of which so many are significant.
_FIREWIRE_FORMATS: Final[tuple[PixelFormatName, ...]] = ("Mono8", "Mono10", "Mono12", "Mono16")


class Region(StrictModel):
    """The part of the sensor that is read out, in px."""

    x: int = Field(0, ge=0, description="first column")
    y: int = Field(0, ge=0, description="first row")
    width: int = Field(640, gt=0, le=16384, description="columns")
    height: int = Field(480, gt=0, le=16384, description="rows")


class IidcSettings(StrictModel):
    """Settings that only FireWire cameras have."""

    bus: int = Field(0, ge=0, le=15, description="which FireWire bus: cameras on one card share its bandwidth")
    iso_speed: Literal[100, 200, 400, 800] = Field(400, description="Mbit/s; 800 needs IEEE 1394b throughout")
    trigger_mode: Literal[0, 1, 14] = Field(
        0,
        description="0: the edge triggers, exposure_us long; 1: the level exposes; 14: as 0, also while the frame "
        "before is read out (Point Grey)",
    )
    format7_mode: int = Field(
        0, ge=0, le=7, description="mode of Format7 that a region is read in; others than 0 never use a fixed format"
    )
    signature: bool = Field(True, description="let AVT cameras sign their frames: times, lost and torn frames")
    dma_frames: int = Field(64, ge=64, le=512, description="frames that the kernel holds while the grabber is busy")
    gain_step_db: float = Field(0.0354, gt=0, le=10, description="gain_db of one step of the gain register (Marlin)")
    shutter_offset_us: float = Field(
        30.0, ge=0, le=10_000, description="added to every exposure by the camera (Marlin F-080B: 30, F-080-30fps: 17)"
    )


class CameraSettings(StrictModel):
    """One camera. The order of the cameras in the file is their order in the triplet, from left to right."""

    name: str = Field(pattern=r"^[A-Za-z][A-Za-z0-9_-]{0,15}$", description="short name, e.g. K1")
    backend: Backend = Field(
        description="aravis: GigE Vision; iidc: FireWire; sim: simulated inside the process; replay: from a log"
    )
    address: str = Field(
        "",
        description="aravis: IP address; iidc: GUID (hexadecimal); replay: path of a log, "
        "relative to the working directory, the same for all cameras; name says which camera of it",
    )
    region: Region = Field(Region(), description="part of the sensor that is read out")
    calibrated_region: Region | None = Field(
        None,
        description="the region with which the camera was calibrated, if it is another one; written when the region is "
        "changed while the service runs. Remove it when interior orientations of the present region are in use",
    )
    pixel_format: PixelFormatName = Field(
        "Mono8",
        description="what the camera sends. Logs hold 8 bits per pixel as mono8, 10 and 12 as mono16, whether packed "
        "or not. iidc: Mono8, or 16 bits of which so many are significant: Mono10, Mono12, Mono16",
    )
    exposure_us: float = Field(2000.0, gt=0, le=1_000_000, description="exposure time, microseconds")
    gain_db: float = Field(0.0, ge=0, le=60, description="gain of the camera; more is brighter and noisier")
    gain_step_db: float | None = Field(
        None,
        gt=0,
        le=10,
        description="aravis: gain_db of one step of GainRaw, for cameras that have their gain in steps alone; iidc has "
        "one of its own",
    )
    gain_raw: int | None = Field(
        None, ge=-(2**31), lt=2**31, description="aravis: GainRaw of the camera, in its own steps, instead of gain_db"
    )
    trigger_input: str = Field("Line0", description="camera input that the trigger cable is plugged into")
    trigger_edge: Literal["rising", "falling"] = Field("rising", description="edge of the pulse that exposes")
    iidc: IidcSettings = Field(IidcSettings(), description="only for backend iidc")

    @property
    def frame_bytes(self) -> int:
        """Bytes of one frame as the camera sends it."""
        return self.format.frame_bytes(self.region.width, self.region.height)

    @property
    def format(self) -> PixelFormat:
        """How the camera sends its pixels."""
        return FORMATS[self.pixel_format]

    @model_validator(mode="after")
    def _address_where_needed(self) -> "CameraSettings":
        if self.backend != "sim" and not self.address:
            raise ValueError(f'backend "{self.backend}" needs an address: add address = "..."')
        return self

    @model_validator(mode="after")
    def _one_gain(self) -> "CameraSettings":
        if self.gain_raw is not None and self.gain_db:
            raise ValueError(f"{self.name} has gain_raw and gain_db, which say the same: remove one of them")
        for key in ("gain_raw", "gain_step_db"):
            if getattr(self, key) is not None and self.backend != "aravis":
                raise ValueError(f'{key} is for backend "aravis" only, {self.name} is "{self.backend}": remove it')
        return self

    @model_validator(mode="after")
    def _lines_hold_whole_groups(self) -> "CameraSettings":
        if self.region.width % (group := self.format.group):
            raise ValueError(
                f"region.width of {self.name} is {self.region.width}: in {self.pixel_format} {group} pixels stand "
                f"together, so make it a multiple of {group}"
            )
        return self

    @model_validator(mode="after")
    def _firewire_keys_make_sense(self) -> "CameraSettings":
        if self.backend != "iidc":
            if "iidc" in self.model_fields_set:
                raise ValueError(f'iidc = ... is for backend "iidc" only, this one is "{self.backend}": remove it')
            return self
        if self.pixel_format not in _FIREWIRE_FORMATS:
            raise ValueError(
                f'pixel_format "{self.pixel_format}" is not for backend "iidc": FireWire cameras send '
                f"{', '.join(_FIREWIRE_FORMATS)} here"
            )
        if not re.fullmatch(r"(0x)?[0-9A-Fa-f]{16}", self.address):
            raise ValueError(
                f'address "{self.address}" is no GUID: give the 16 hexadecimal digits of the camera\'s label, '
                "or of svev doctor --bus firewire"
            )
        if not re.fullmatch(r"Line[0-3]", self.trigger_input):
            raise ValueError(
                f'trigger_input "{self.trigger_input}" is no input of a FireWire camera: use "Line0" to "Line3"'
            )
        return self
