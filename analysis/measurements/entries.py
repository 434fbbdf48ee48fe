"""The entries of a `svev-measurements/1` file; unknown keys, wrong types and impossible values are refused."""

from itertools import pairwise
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, model_validator

from analysis.measurements.model import Source
from photogrammetry.network.entries import Finite, Pixels, Positive
from rig.settings.strict_toml import StrictModel

FORMAT = "svev-measurements/1"
#: Standard deviation of what a person measured, where the file gives none, px.
SIGMA_BY_HAND = 0.5
#: How far outside of an image a place may be, as part of its size: that of a thing which the edge of the image cuts.
_OUTSIDE = 0.05
_LAST_NS = 2**63 - 1


def _listed(value: Any) -> Any:
    """One number as a list of one."""
    return [value] if isinstance(value, int | float) and not isinstance(value, bool) else value


Place = Annotated[list[Finite], Field(min_length=2, max_length=2)]
Sigmas = Annotated[list[Positive], BeforeValidator(_listed), Field(min_length=1)]
Whole = Annotated[int, Field(strict=True, ge=0, le=_LAST_NS)]
Side = Literal["right", "left"]
PointName = Literal["P1", "P2", "P3", "P4"]


class _Measured(StrictModel):
    source: Source = Source.BY_HAND
    sigma: Sigmas | None = None

    def check_sigma(self, count: int, what: str) -> None:
        """Refuse sigmas that are neither one nor `count`, and automatic measurements without."""
        if self.sigma is None and self.source is Source.AUTOMATIC:
            raise ValueError('an automatic measurement has no "sigma"; add it, or say "source": "by hand"')
        if self.sigma is not None and len(self.sigma) not in (1, count):
            raise ValueError(f'"sigma" has {len(self.sigma)} numbers; give one, or {count}: {what}')

    def sigmas(self, count: int) -> list[float]:
        """`count` standard deviations, px."""
        given = self.sigma or [SIGMA_BY_HAND]
        return given if len(given) == count else given * count


class PointEntry(_Measured):
    """One of `points`."""

    xy: Place
    correlation: Annotated[float, Field(strict=True, gt=-1, lt=1)] = 0.0

    @model_validator(mode="after")
    def _sigma_fits(self) -> "PointEntry":
        self.check_sigma(2, "of x and of y")
        return self


class SkiEntry(_Measured):
    """One of `skis`."""

    xy: Annotated[list[Place], Field(min_length=2)]
    common: Annotated[float, Field(strict=True, ge=0, allow_inf_nan=False)] = 0.0
    lasting: Annotated[float, Field(strict=True, ge=0, allow_inf_nan=False)] = 0.0

    @model_validator(mode="after")
    def _sigma_fits(self) -> "SkiEntry":
        self.check_sigma(len(self.xy), "one for each point")
        return self


class ImageEntry(StrictModel):
    """One of `images`."""

    points: dict[PointName, PointEntry] = Field(default={})
    skis: dict[Side, SkiEntry] = Field(default={})

    def outside(self, width: int, height: int) -> str | None:
        """What was measured outside of the image, for a message."""
        places: list[tuple[str, list[float]]] = [(name, point.xy) for name, point in self.points.items()]
        places += [(f"{side} ski", xy) for side, ski in self.skis.items() for xy in ski.xy]
        for name, (x, y) in places:
            if not (-_OUTSIDE <= x / width <= 1 + _OUTSIDE and -_OUTSIDE <= y / height <= 1 + _OUTSIDE):
                return f"{name} is at ({x:g}, {y:g})"
        return None


class PulseEntry(StrictModel):
    """One of `pulses`."""

    pulse: Whole
    time_ns: Annotated[str, Field(strict=True, pattern=r"^\d{1,18}\d?$")] | None = None
    images: dict[str, ImageEntry] = Field(default={})


class JumpEntry(StrictModel):
    """One of `jumps`."""

    number: Annotated[int, Field(strict=True, ge=1)]
    pulses: Annotated[list[PulseEntry], Field(min_length=1)]


class CameraEntry(StrictModel):
    """One of `cameras`."""

    size: Annotated[list[Pixels], Field(min_length=2, max_length=2)]
    exposure_s: Annotated[float, Field(strict=True, ge=0, le=1, allow_inf_nan=False)] = 0.0


class MeasurementsEntry(StrictModel):
    """The file."""

    format: Literal["svev-measurements/1"]
    recording: str = ""
    rate_hz: Annotated[float, Field(strict=True, gt=0, le=10_000, allow_inf_nan=False)]
    cameras: dict[str, CameraEntry]
    jumps: list[JumpEntry]

    @model_validator(mode="after")
    def _fits_together(self) -> "MeasurementsEntry":
        pulses = [pulse for jump in self.jumps for pulse in jump.pulses]
        numbers = [pulse.pulse for pulse in pulses]
        for name, values in (("jump", [jump.number for jump in self.jumps]), ("pulse", numbers)):
            if twice := next((value for value in values if values.count(value) > 1), None):
                raise ValueError(f"{name} {twice} stands twice; put what belongs to it into one entry")
        for pulse in pulses:
            self._check_images(pulse)
        self._check_times(pulses)
        return self

    def _check_images(self, pulse: PulseEntry) -> None:
        for camera, image in pulse.images.items():
            if camera not in self.cameras:
                there = ", ".join(self.cameras) or "none"
                raise ValueError(f'pulse {pulse.pulse}: "cameras" has no {camera} (there: {there}); add it there')
            width, height = self.cameras[camera].size
            if wrong := image.outside(width, height):
                raise ValueError(
                    f"pulse {pulse.pulse}, {camera}: {wrong}, outside of its image of {width} x {height} px; "
                    'correct the place, or "size" of the camera'
                )

    def _check_times(self, pulses: list[PulseEntry]) -> None:
        missing = [pulse.pulse for pulse in pulses if pulse.time_ns is None]
        if missing and len(missing) < len(pulses):
            raise ValueError(f'pulse {missing[0]} has no "time_ns", but others have; give it to all or to none')
        ordered = sorted((pulse.pulse, int(pulse.time_ns)) for pulse in pulses if pulse.time_ns is not None)
        for (before, earlier), (after, later) in pairwise(ordered):
            if later <= earlier:
                raise ValueError(f'"time_ns" of pulse {after} is not after that of pulse {before}; correct them')
