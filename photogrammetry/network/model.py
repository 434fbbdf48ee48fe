"""A photogrammetric network in memory: cameras, images, points and observations as every procedure takes them.

Image coordinates are metric here (x right, y up, origin at the image centre), also if the file's frame is `pixel`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from photogrammetry.geometry.camera_model import Distortion, Lens
from rig.arrays import Floats, Integers

AXES = ("X", "Y", "Z")
#: Names of the groups of observations that are no image groups (variance components).
RESERVED_GROUPS = ("control", "distance", "difference", "camera", "pose")


class ImageFrame(StrEnum):
    """The frame of image coordinates in the file."""

    METRIC = "metric"
    PIXEL = "pixel"


class Role(StrEnum):
    """How the adjustment treats a point."""

    CONTROL = "control"  #: surveyed: an unknown whose given coordinates are a weighted observation (paper D3b)
    FIXED = "fixed"  #: error-free
    TIE = "tie"  #: unknown
    CHECK = "check"  #: unknown; its given coordinates are only compared afterwards


class DatumType(StrEnum):
    """What defines the object system."""

    CONTROL = "control"
    INNER = "inner"


class Reweight(StrEnum):
    """How the weights of the observations are found."""

    NONE = "none"  #: as given
    HELMERT = "helmert"  #: true group redundancies (Helmert/Foerstner)
    PAPER = "paper"  #: equations D5a, D5b as printed


@dataclass(frozen=True, slots=True, eq=False)
class Camera:
    """A camera's interior orientation.

    Attributes:
        name: unique.
        interior: (10,), in the order of `camera_model.INTERIOR`, image unit, metric frame.
        balance: radius r0 of the balanced radial distortion; 0: unbalanced.
        distortion: the side it acts on.
        size: width, height (px); None where unknown (metric frame only).
        estimate: names of the unknown parameters, in the order of `INTERIOR`.
        sigma: standard deviations of those whose given value is a weighted observation.
    """

    name: str
    interior: Floats
    balance: float = 0.0
    distortion: Distortion = Distortion.PROJECTED
    size: tuple[int, int] | None = None
    estimate: tuple[str, ...] = ()
    sigma: Mapping[str, float] = field(default_factory=dict)

    def lens(self) -> Lens:
        """The interior orientation as the camera model takes it; broadcasts over observations."""
        return Lens(self.interior, np.asarray(self.balance), np.asarray(self.distortion is Distortion.MEASURED))


@dataclass(frozen=True, slots=True, eq=False)
class Image:
    """An image and its pose.

    Attributes:
        name: unique.
        camera: index of the camera in the network.
        position: (3,) projection centre X0; None: not known yet.
        rotation: (3, 3), columns are the camera's axes; None: not known yet.
        estimate: whether the pose is unknown.
        sigma_position: (3,), where the given X0 is a weighted observation (paper D.2).
        sigma_angles: (3,) rad about the camera's own axes, where the given R is a weighted observation.
    """

    name: str
    camera: int
    position: Floats | None = None
    rotation: Floats | None = None
    estimate: bool = True
    sigma_position: Floats | None = None
    sigma_angles: Floats | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Point:
    """An object point.

    Attributes:
        name: unique.
        role: how the adjustment treats it.
        xyz: (3,) given coordinates; None: not known yet (tie points only).
        sigma: (3,) of a control point.
    """

    name: str
    role: Role
    xyz: Floats | None = None
    sigma: Floats | None = None


@dataclass(frozen=True, slots=True, eq=False)
class ImageObservations:
    """n observed image points, column by column.

    Attributes:
        image: (n,) index of the image in the network.
        point: (n,) index of the point.
        xy: (n, 2) metric image coordinates.
        sigma: (n, 2) a-priori standard deviations.
        group: (n,) index into `groups`.
        groups: names of the groups for the variance components.
    """

    image: Integers
    point: Integers
    xy: Floats
    sigma: Floats
    group: Integers
    groups: tuple[str, ...] = ("image",)


@dataclass(frozen=True, slots=True)
class Distance:
    """An observed distance between two points (indices)."""

    start: int
    end: int
    value: float
    sigma: float


@dataclass(frozen=True, slots=True)
class Difference:
    """An observed coordinate difference, X(end) - X(start) along `axis` (0, 1, 2), paper equation (3)."""

    start: int
    end: int
    axis: int
    value: float
    sigma: float


@dataclass(frozen=True, slots=True)
class Datum:
    """What defines the object system; `points`: indices of the datum points of a free network, None: all."""

    type: DatumType = DatumType.CONTROL
    points: tuple[int, ...] | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Network:
    """A network; its parts refer to each other by index. Use `dataclasses.replace` to make a changed copy."""

    cameras: tuple[Camera, ...]
    images: tuple[Image, ...]
    points: tuple[Point, ...]
    observations: ImageObservations
    distances: tuple[Distance, ...] = ()
    differences: tuple[Difference, ...] = ()
    datum: Datum = Datum()
    length_unit: str = ""
    ball_radius_m: float | None = None  #: of the balls that signalise points, which all have one; None: not known
    image_frame: ImageFrame = ImageFrame.METRIC
    sigma0: float = 1.0
    reweight: Reweight = Reweight.NONE

    @property
    def image_unit(self) -> str:
        """The unit of image coordinates, for people."""
        return "px" if self.image_frame is ImageFrame.PIXEL else "image units"
