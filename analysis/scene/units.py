"""Refuses surveys in other units than metres and pixels."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from photogrammetry.network.model import Camera, Point
from rig.errors import BadInputError
from rig.phrase import phrase

#: Radius of a ball, m: smaller ones no camera resolves from where a jump fits into its image, larger ones hide the
#: jumper. Coordinates in mm or cm make a ball hundreds of times as large, those in km as small.
_RADII_M: Final = (0.005, 2.0)
_METRES: Final = ("", "m", "metre", "metres", "meter", "meters")  # as a label; the file need not have one
#: Nobody surveys a ball as poorly as this, m; millimetres make a sigma of 12.
_SIGMA_M: Final = 1.0
#: c over the width of the picture: a lens that sees so much is a fisheye, c in mm is smaller.
_SHORTEST: Final = 0.2


def require_metres(unit: str, source: str) -> None:
    """Refuse an object system whose unit is another than the metre, in which speeds and lengths of a jump are told.

    Args:
        unit: `length_unit` of the file.
        source: the file, for messages.

    Raises:
        BadInputError: it is another unit.
    """
    if unit.strip().lower() not in _METRES:
        raise BadInputError(
            phrase(
                "survey_unit",
                '{source}: "length_unit" is "{unit}", but jumps are measured in metres; write coordinates and sigmas '
                'in metres, and "length_unit": "m"',
                source=source,
                unit=unit,
            )
        )


def check_lengths(radius: float | None, source: str) -> None:
    """Refuse a survey that makes the balls in the images larger or smaller than balls can be.

    Args:
        radius: of the balls in the unit of the survey; None if it is not known.
        source: the file, for messages.

    Raises:
        BadInputError: its coordinates are no metres.
    """
    if radius is not None and not _RADII_M[0] <= radius <= _RADII_M[1]:
        raise BadInputError(
            phrase(
                "survey_no_metres",
                "{source}: with these coordinates the balls in the images are {size:.2g} m across, so they are not "
                "in metres; write coordinates and their sigmas in metres",
                source=source,
                size=2 * radius,
            )
        )


def check_sigmas(points: Sequence[Point], source: str) -> None:
    """Refuse surveyed balls whose sigma is no length that anybody surveys to.

    Args:
        points: of the survey.
        source: the file, for messages.

    Raises:
        BadInputError: a sigma is larger than a metre.
    """
    for point in points:
        if point.sigma is not None and (sigma := float(np.max(point.sigma))) > _SIGMA_M:
            raise BadInputError(
                phrase(
                    "survey_sigma",
                    "{source}: the sigma of ball {ball} is {sigma} m, by which nothing can be named; write sigmas in "
                    "metres, such as 0.012",
                    source=source,
                    ball=point.name,
                    sigma=float(f"{sigma:.3g}"),
                )
            )


def check_principal_distances(cameras: Sequence[Camera], source: str) -> None:
    """Refuse principal distances that are not in pixels.

    Args:
        cameras: of the survey.
        source: the file, for messages.

    Raises:
        BadInputError: a camera would see more than any lens without a fisheye does.
    """
    for camera in cameras:
        c = float(camera.interior[0])
        if camera.size is not None and c < _SHORTEST * camera.size[0]:
            raise BadInputError(
                phrase(
                    "survey_c",
                    "{source}: camera {camera} has c = {c} px, so its picture of {width} px would be {angle} degrees "
                    "wide; write c in px: focal length / size of a pixel",
                    source=source,
                    camera=camera.name,
                    c=float(f"{c:.4g}"),
                    width=camera.size[0],
                    angle=round(float(2.0 * np.degrees(np.arctan2(camera.size[0] / 2.0, c)))),
                )
            )
