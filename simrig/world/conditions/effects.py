"""Tables of a scenario that make its images harder to measure. Every default leaves the images as they are without it.

Lengths in px belong to an image 640 px wide, like the principal distances; times are scene times in s.
"""

from typing import Literal

from pydantic import ConfigDict, Field, model_validator

from rig.settings.strict_toml import StrictModel

Vector = tuple[float, float, float]
Marker = Literal["P1", "P2", "P3", "P4"]


class FiniteModel(StrictModel):
    """A table whose numbers are all finite."""

    model_config = ConfigDict(allow_inf_nan=False)


class LensErrors(FiniteModel):
    """Principal point and distortion of a lens, as in the network file with `distortion: "projected"`; px at 640 px."""

    x0: float = Field(0.0, ge=-50, le=50, description="principal point, to the right of the image centre")
    y0: float = Field(0.0, ge=-50, le=50, description="principal point, above the image centre")
    a1: float = Field(0.0, ge=-1e-5, le=1e-5, description="radial distortion, px^-2")
    a2: float = Field(0.0, ge=-1e-10, le=1e-10, description="radial distortion, px^-4")
    a3: float = Field(0.0, ge=-1e-15, le=1e-15, description="radial distortion, px^-6")
    r0: float = Field(0.0, ge=0, le=1000, description="radius at which the radial distortion is balanced")
    b1: float = Field(0.0, ge=-1e-4, le=1e-4, description="decentring, px^-1")
    b2: float = Field(0.0, ge=-1e-4, le=1e-4, description="decentring, px^-1")
    c1: float = Field(0.0, ge=-0.05, le=0.05, description="affinity")
    c2: float = Field(0.0, ge=-0.05, le=0.05, description="shear")


class Move(FiniteModel):
    """A movement of one camera. It grows evenly from `from_s` to `until_s`, and stays; a knock takes no time."""

    from_s: float = Field(ge=0)
    until_s: float | None = Field(None, ge=0, description="none: at once, a knock")
    rotation_deg: Vector = Field((0.0, 0.0, 0.0), description="about the camera's own axes r1, r2, r3")
    shift_m: Vector = Field((0.0, 0.0, 0.0), description="of the projection centre, in the object system")

    @model_validator(mode="after")
    def _in_order(self) -> "Move":
        if self.until_s is not None and self.until_s < self.from_s:
            raise ValueError(
                f"a move ends at {self.until_s} s, before it begins: give until_s of {self.from_s} or more"
            )
        return self


class MissingMarker(FiniteModel):
    """A marker that a jumper does not wear."""

    marker: Marker
    jump: int | None = Field(None, ge=0, description="number of the jump, counted from 0; none: all jumps")


class Sun(FiniteModel):
    """A sun that shades the balls, with the light of sky and snow; radiances are shares of white.

    With `direct = 0` the sky is overcast. What becomes brighter than white is white.
    """

    azimuth_deg: float = Field(ge=-360, le=360, description="where it stands: 0 along X, 90 along Y, to the left")
    elevation_deg: float = Field(ge=-5, le=90)
    direct: float = Field(0.75, ge=0, le=2, description="of a ball's point that faces the sun")
    sky: float = Field(0.25, ge=0, le=1, description="light from above")
    snow: float = Field(0.15, ge=0, le=1, description="light from below")
    roughness_deg: float = Field(20.0, ge=0, le=60, description="of the surface (Oren and Nayar); 0: Lambert")
    gloss: float = Field(0.0, ge=0, le=2, description="radiance of the highlight")


class Light(FiniteModel):
    """Light that changes over time, light from one side, and light that should not be there."""

    cloud_depth: float = Field(0.0, ge=0, le=0.9, description="share of the light that the darkest cloud takes")
    cloud_period_s: float = Field(12.0, gt=0.5, description="typical time from cloud to cloud")
    flicker: float = Field(0.0, ge=0, le=1, description="share of the light that floodlights lose between two peaks")
    flicker_hz: float = Field(100.0, gt=0, le=1000)
    glare_spots: int = Field(0, ge=0, le=50, description="bright spots in each lens, which stay where they are")
    reflections: int = Field(0, ge=0, le=200, description="spots on the snow, as bright as markers, that come and go")
    sun: Sun | None = Field(None, description="shades the balls; none: they are evenly bright")

    @property
    def changes(self) -> bool:
        """Whether it differs from image to image, or comes into the lens."""
        return bool(self.cloud_depth or self.flicker or self.glare_spots or self.reflections)


class Weather(FiniteModel):
    """Snow in the air and on the lenses."""

    snowfall: float = Field(0.0, ge=0, le=1, description="0: none, 1: so dense that a fifth of the view is covered")
    lens_snow: int = Field(0, ge=0, le=50, description="soft blobs of snow on each lens")

    @property
    def changes(self) -> bool:
        """Whether any of it is to be seen."""
        return bool(self.snowfall or self.lens_snow)


class Tower(FiniteModel):
    """A judge's tower: an upright box. It hides what is behind it."""

    X: Vector = Field(description="middle of its foot")
    size_m: Vector = Field((3.0, 3.0, 8.0), description="along X, along Y, height")
    radiance: float = Field(110.0, ge=0, le=225)


class Person(FiniteModel):
    """Somebody who is no jumper in flight. An official walks up and down; a jumper waits, with skis and markers."""

    kind: Literal["official", "jumper"]
    X: Vector = Field(description="where the feet are; the middle of the skis of a jumper")
    walk_m: float = Field(0.5, ge=0, le=30, description="official: length of the walk along X")


class Surroundings(FiniteModel):
    """What stands and moves around the jumping hill."""

    trees: int = Field(0, ge=0, le=60, description="trees that sway")
    flags: int = Field(0, ge=0, le=40)
    spectators: int = Field(0, ge=0, le=60, description="people who walk along the far side of the knoll")
    towers: tuple[Tower, ...] = Field((), max_length=8)
    people: tuple[Person, ...] = Field((), max_length=20)

    @property
    def changes(self) -> bool:
        """Whether any of it is to be seen."""
        return bool(self.trees or self.flags or self.spectators or self.towers or self.people)
