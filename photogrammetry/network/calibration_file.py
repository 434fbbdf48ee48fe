"""Reads interior orientations from the result file of a calibration."""

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field

from photogrammetry.network.entries import Finite, Pixels, Positive
from photogrammetry.network.formats import RESULT, require_format
from photogrammetry.network.model import ImageFrame
from photogrammetry.network.strict_text import read_json
from rig.errors import BadInputError
from rig.settings.strict_toml import validate


class CalibratedCamera(BaseModel):
    """One of `cameras` of a result; its sigmas and correlations are ignored."""

    c: Positive
    x0: Finite
    y0: Finite
    a1: Finite
    a2: Finite
    a3: Finite
    b1: Finite
    b2: Finite
    c1: Finite
    c2: Finite
    r0: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0.0)]
    distortion: Literal["projected", "measured"]
    size: Annotated[list[Pixels], Field(min_length=2, max_length=2)] | None = None


class _GlobalTest(BaseModel):
    """What the global test says; results of other programs have none."""

    usable: bool = True
    words: str = ""


class _Result(BaseModel):
    """The keys of a result that a calibration must have; all others are ignored."""

    format: Literal["svev-adjustment/1"]
    converged: bool
    image_frame: ImageFrame | None = None
    cameras: dict[str, Any] = {}
    global_test: _GlobalTest = _GlobalTest()


def read_calibration(path: Path, frame: ImageFrame | None = None) -> dict[str, CalibratedCamera]:
    """Read the cameras of a result file (`svev-adjustment/1`).

    Args:
        path: of the file.
        frame: in which the cameras are wanted; None: in that of the file, whatever it is.

    Raises:
        BadInputError: missing, unreadable, no result file, one of a calibration that did not converge or whose
            observations contradict each other, or one with image coordinates of another frame.
    """
    data = read_json(path)
    require_format(data, RESULT, path)
    result = validate(_Result, data, path)
    if not result.converged:
        raise BadInputError(f"{path}: this calibration has no result; calibrate again or name another file")
    if not result.global_test.usable:
        raise BadInputError(f"{path}: sigma0 of this result is {result.global_test.words}")
    if frame is not None and result.image_frame not in (None, frame):
        raise BadInputError(
            f'{path}: "image_frame" is "{result.image_frame}", and cameras of "{frame}" are wanted, whose c, x0, y0 '
            "have another unit; calibrate with image coordinates of that frame"
        )
    return {name: _camera(body, f"{path}: cameras.{name}") for name, body in result.cameras.items()}


def _camera(body: Any, source: str) -> CalibratedCamera:
    if not isinstance(body, dict):
        raise BadInputError(f"{source}: is no object; name the result file of a calibration")
    return validate(CalibratedCamera, body, source)
