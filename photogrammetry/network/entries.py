"""The entries of a `svev-network/1` file; unknown keys, wrong types and impossible values are refused."""

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from photogrammetry.geometry.camera_model import INTERIOR
from rig.settings.strict_toml import StrictModel

#: Limits in any unit: of lengths, image coordinates and parameters; of sigmas (that of a3 may be 1e-30).
LARGEST, SMALLEST = 1e12, 1e-60


def _large_enough(value: float) -> float:
    if value < SMALLEST:
        raise ValueError(f"is smaller than {SMALLEST:g}, which no unit needs")
    return value


Finite = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-LARGEST, le=LARGEST)]
Positive = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0, le=LARGEST), AfterValidator(_large_enough)]
Triple = Annotated[list[Finite], Field(min_length=3, max_length=3)]
Sigmas = Annotated[list[Positive], Field(min_length=3, max_length=3)]
Pixels = Annotated[int, Field(strict=True, gt=0, le=1_000_000)]
Name = Annotated[str, Field(strict=True)]

#: How far the rows of R may be from orthonormal: enough for numbers rounded to five digits.
_ORTHONORMAL = 1e-4


def _is_rotation(rows: list[list[float]]) -> list[list[float]]:
    matrix = np.clip(np.array(rows), -10.0, 10.0)  # larger elements are no rotation either
    if np.abs(matrix @ matrix.T - np.eye(3)).max() > _ORTHONORMAL:
        raise ValueError("its rows are not orthonormal; give a rotation matrix row by row, with more digits")
    if np.linalg.det(matrix) < 0.0:
        raise ValueError("is a reflection (determinant -1); exchange the sign of one row or column")
    return rows


Rotation = Annotated[list[Triple], Field(min_length=3, max_length=3), AfterValidator(_is_rotation)]


class CameraEntry(StrictModel):
    """One of `cameras`."""

    size: Annotated[list[Pixels], Field(min_length=2, max_length=2)] | None = None
    c: Positive
    x0: Finite = 0.0
    y0: Finite = 0.0
    a1: Finite = 0.0
    a2: Finite = 0.0
    a3: Finite = 0.0
    r0: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0, le=LARGEST)] = 0.0
    b1: Finite = 0.0
    b2: Finite = 0.0
    c1: Finite = 0.0
    c2: Finite = 0.0
    distortion: Literal["projected", "measured"] = "projected"
    estimate: list[Name] = Field(default=[])
    sigma: dict[Name, Positive] = Field(default={})

    @model_validator(mode="after")
    def _parameters_are_known(self) -> "CameraEntry":
        for parameter in self.estimate:
            if parameter not in INTERIOR:
                raise ValueError(f'"estimate" names "{parameter}"; the parameters are {", ".join(INTERIOR)}')
        if len(set(self.estimate)) < len(self.estimate):
            raise ValueError('"estimate" names a parameter twice; remove one')
        for parameter in self.sigma:
            if parameter not in self.estimate:
                raise ValueError(f'"sigma" has "{parameter}", which "estimate" lacks; add it there or drop its sigma')
        return self


class PoseSigmaEntry(StrictModel):
    """`sigma` of an image."""

    X0: Sigmas | None = None
    angles: Sigmas | None = None


class ImageEntry(StrictModel):
    """One of `images`."""

    camera: Name
    X0: Triple | None = None
    R: Rotation | None = None
    estimate: Annotated[bool, Field(strict=True)] = True
    sigma: PoseSigmaEntry | None = None

    @model_validator(mode="after")
    def _pose_is_given_where_needed(self) -> "ImageEntry":
        if not self.estimate and (self.X0 is None or self.R is None):
            raise ValueError('the pose is constant ("estimate": false) but not given; add "X0" and "R" or estimate it')
        if self.sigma is None:
            return self
        if not self.estimate:
            raise ValueError('a constant pose ("estimate": false) has no "sigma"; drop it or estimate the pose')
        if (self.sigma.X0 is not None and self.X0 is None) or (self.sigma.angles is not None and self.R is None):
            raise ValueError('"sigma" belongs to a given pose; add "X0" and "R" or drop it')
        return self


class PointEntry(StrictModel):
    """One of `points`."""

    role: Literal["control", "fixed", "tie", "check"]
    X: Triple | None = None
    sigma: Sigmas | None = None

    @model_validator(mode="after")
    def _coordinates_are_given_where_needed(self) -> "PointEntry":
        if self.role != "tie" and self.X is None:
            raise ValueError(f'a {self.role} point needs its coordinates; add "X" or make it a tie point')
        if self.role == "control" and self.sigma is None:
            raise ValueError('a control point needs "sigma": [sX, sY, sZ]; add it or make the point fixed')
        if self.role != "control" and self.sigma is not None:
            raise ValueError(f'a {self.role} point has no "sigma"; drop it or make it a control point')
        return self


class DistanceEntry(StrictModel):
    """One of `distances`; `from` is a keyword, hence the alias."""

    start: Name = Field(alias="from")
    end: Name = Field(alias="to")
    value: Positive
    sigma: Positive


class DifferenceEntry(StrictModel):
    """One of `differences`."""

    start: Name = Field(alias="from")
    end: Name = Field(alias="to")
    axis: Literal["X", "Y", "Z"]
    value: Finite
    sigma: Positive


class DatumEntry(StrictModel):
    """`datum`."""

    type: Literal["control", "inner"]
    points: list[Name] | None = None


class NetworkEntry(StrictModel):
    """The whole file; its entries are validated one by one, so that each error names its place."""

    format: Literal["svev-network/1"]
    length_unit: Name = ""
    ball_radius_m: Positive | None = None
    image_frame: Literal["metric", "pixel"]
    sigma0: Positive = 1.0
    cameras: dict[str, Any]
    images: dict[str, Any]
    points: dict[str, Any]
    observations: list[Any]
    distances: list[Any] = Field(default=[])
    differences: list[Any] = Field(default=[])
    datum: Any = Field(default={"type": "control"})
    reweight: Literal[True, False, "paper"] = False
