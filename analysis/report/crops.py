"""The jumper cut out of every image, encoded so that a page with all of them stays small."""

import base64
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from analysis.cameras.frames import camera_images
from analysis.report.frames import Grey, frames_of
from analysis.report.overlay import Overlay
from analysis.scene.camera_system import CameraSystem
from rig.arrays import Floats

#: Size of a crop in page units.
CROP_WIDTH, CROP_HEIGHT = 320, 240
_ASPECT = CROP_WIDTH / CROP_HEIGHT
_MARGIN_FACTOR = 1.15  # around the largest jumper that a camera shows
_LEAST_PX = 48.0  # a smaller window shows nothing of what is around the jumper
#: From the best to the smallest: width of a picture in px, quality of WebP.
_LEVELS = ((480, 80), (400, 72), (320, 65), (256, 55), (200, 45), (160, 35))
_SAMPLES = 12  # pictures that decide on the level
_BASE64 = 4 / 3


@dataclass(frozen=True, slots=True, eq=False)
class Window:
    """Where a crop is cut.

    Attributes:
        left: first column.
        top: first row.
        width: columns.
        height: rows.
    """

    left: int
    top: int
    width: int
    height: int

    @property
    def corner(self) -> Floats:
        """(2,) px, the outer top left corner; (0, 0) is the centre of the image's first pixel."""
        return np.array((self.left, self.top)) - 0.5

    def on_page(self, overlay: Overlay) -> Overlay:
        """An overlay of the image in page units of the crop."""
        return overlay.mapped(self.corner, CROP_WIDTH / self.width)

    def cut(self, image: Grey) -> Grey:
        """This part of an image, as large as the best level shows it."""
        part = image[self.top : self.top + self.height, self.left : self.left + self.width]
        return _resized(part, min(_LEVELS[0][0], max(self.width, CROP_WIDTH)))


@dataclass(frozen=True, slots=True, eq=False)
class Crop:
    """A picture of the jumper.

    Attributes:
        data: its `data:` address.
        window: where it was cut.
    """

    data: str
    window: Window


Windows = dict[tuple[int, str], Window]


def windows_of(overlays: Mapping[int, Mapping[str, Overlay]], system: CameraSystem) -> Windows:
    """By pulse and camera the part of the image around the jumper; all of a camera are equally large.

    An image that does not show the middle of the jumper has none.

    Args:
        overlays: by pulse and camera.
        system: the cameras.
    """
    middles: dict[tuple[int, str], Floats] = {}
    widths: dict[str, float] = {}
    for pulse, images in overlays.items():
        for name, overlay in images.items():
            places = overlay.places()
            if len(places) == 0:
                continue
            middle = (places.min(axis=0) + places.max(axis=0)) / 2
            if ((middle >= 0) & (middle < system[name].size)).all():
                middles[pulse, name] = middle
                across, down = np.ptp(places, axis=0)
                widths[name] = max(
                    widths.get(name, _LEAST_PX), across * _MARGIN_FACTOR, down * _ASPECT * _MARGIN_FACTOR
                )
    return {key: _window(middle, widths[key[1]], system[key[1]].size) for key, middle in middles.items()}


def crops_of(log: Path, windows: Windows, budget: int) -> dict[tuple[int, str], Crop]:
    """Crops by pulse and camera, in the best quality that the budget allows.

    Args:
        log: where the images are; cameras that did not deliver have no crop.
        windows: what to cut.
        budget: bytes that all crops together may need on the page.

    Raises:
        BadInputError: the log cannot be read.
    """
    parts: dict[tuple[int, str], Grey] = {}
    for tag, image in frames_of(log, {pulse for pulse, _ in windows}):
        for name, own in camera_images(tag, image).items():
            if (key := (int(tag.pulse), name)) in windows:
                parts[key] = windows[key].cut(own)
    level = _level(list(parts.values()), budget)
    return {key: Crop(_address(_encoded(part, *level)), windows[key]) for key, part in parts.items()}


def _window(middle: Floats, width: float, size: Floats) -> Window:
    """A window of the crops' shape about a place, moved and shrunk to lie within the image."""
    step = CROP_WIDTH // math.gcd(CROP_WIDTH, CROP_HEIGHT)  # so that the shape is exact: overlays must fit
    across = int(min(width, float(size[0]), float(size[1]) * _ASPECT)) // step * step
    extent = np.array((across, across * CROP_HEIGHT // CROP_WIDTH))
    corner = np.clip(np.rint(middle - extent / 2).astype(int), 0, size.astype(int) - extent)
    return Window(int(corner[0]), int(corner[1]), int(extent[0]), int(extent[1]))


def _level(parts: Sequence[Grey], budget: int) -> tuple[int, int]:
    """The best level at which a sample of the pictures says that all fit into the budget."""
    sample = [parts[i] for i in np.unique(np.linspace(0, len(parts) - 1, _SAMPLES).astype(int))] if parts else []
    for level in _LEVELS[:-1]:
        bytes_each = np.mean([len(_encoded(part, *level)) for part in sample]) if sample else 0.0
        if bytes_each * _BASE64 * len(parts) <= budget:
            return level
    return _LEVELS[-1]


def _encoded(part: Grey, width: int, quality: int) -> bytes:
    _, data = cv2.imencode(".webp", _resized(part, min(width, part.shape[1])), [cv2.IMWRITE_WEBP_QUALITY, quality])
    return data.tobytes()


def _address(data: bytes) -> str:
    return "data:image/webp;base64," + base64.b64encode(data).decode("ascii")


def _resized(part: Grey, width: int) -> Grey:
    if width == part.shape[1]:
        return part.copy()
    size = (width, max(1, round(width / _ASPECT)))
    method = cv2.INTER_AREA if width < part.shape[1] else cv2.INTER_CUBIC
    return np.asarray(cv2.resize(part, size, interpolation=method), np.uint8)
