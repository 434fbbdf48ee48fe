"""Renders printed sheets, a board or a frame of targets, before a plain wall, by ray, as one camera sees them."""

from typing import Final

import cv2
import numpy as np

from rig.arrays import Floats
from rig.images.pixels import Stored
from rig.pulse import HillPulse
from simrig.images.scene.drawing import Image
from simrig.images.sensor import Sensor
from simrig.world.board import MM_PER_M, BoardPose, HeldBoard, Placed, Sheet, load_sheets, placed
from simrig.world.projection import Projection
from simrig.world.scenario import Scenario

#: Radiances.
_BLACK: Final = 25.0
_WHITE: Final = 205.0
_WALL: Final = 110.0
_FINE: Final = 4  # rays along a pixel's side, while the board is still
_OUTLINE: Final = np.array([(-1, -1), (0, -1), (1, -1), (1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0)], dtype=float)
_SPARE_PX: Final = 8  # around the corners of a sheet: its sides are bent by the lens
_IDEAL_PLACE_STEPS: Final = 20  # of finding the ideal place that a lens shows at a given one, at most
_ENOUGH_PX: Final = 1e-4  # of a step: below what single precision tells apart at the edge of the largest pictures


class BoardView:
    """Renders one camera's images; the same seed, camera and pulse give the same image.

    Pictures of the board while it is still are drawn finely and once; between them it is drawn coarsely, unblurred.

    Args:
        scenario: what there is to see.
        board: that it shows, or a frame of targets.
        camera: index of the camera in it.
        width: width of the image, px.
        height: height of the image, px.
        rate_hz: rate of the pulses.
        bits: of a pixel.

    Raises:
        BadInputError: the sheets cannot be read.
    """

    def __init__(
        self, scenario: Scenario, board: HeldBoard, camera: int, width: int, height: int, rate_hz: float, bits: int = 8
    ) -> None:
        self._settings, self._board, self._rate_hz = scenario.cameras[camera], board, rate_hz
        before = scenario.cameras[scenario.camera_index(board.before)]
        self._before = before.projection(width, height)
        self._projection = self._settings.projection(width, height)
        self._sheets = [(sheet, _raster(sheet)) for sheet in load_sheets(board.pattern)]
        ideal = _ideal(self._projection)
        self._coarse, self._fine = _rays(ideal, 1), _rays(ideal, _FINE)
        self._blur = scenario.image.blur_sigma_px * _FINE
        self._gain, self._black_level = np.float32(self._settings.gain), np.float32(scenario.image.black_level)
        self._sensor = Sensor(scenario.image, scenario.seed, camera, (height, width), bits)
        self._drawn: dict[BoardPose, Image] = {}

    def render_into(self, out: Stored, pulse: HillPulse) -> None:
        """Render the image of hill pulse `pulse` into `out`, shape (height, width); its rows may lie apart."""
        pose, still = self._board.at(self._settings.middle_s(pulse, self._rate_hz))
        if still and pose not in self._drawn:
            blurred = cv2.GaussianBlur(self._seen(pose, self._fine), (0, 0), self._blur)
            size = self._projection.width, self._projection.height
            self._drawn[pose] = np.asarray(cv2.resize(blurred, size, interpolation=cv2.INTER_AREA), np.float32)
        radiance = self._drawn[pose].copy() if still else self._seen(pose, self._coarse)
        radiance *= self._gain
        radiance += self._black_level
        self._sensor.read(radiance, out, pulse)

    def _seen(self, pose: BoardPose, ideal: tuple[Image, Image]) -> Image:
        """What rays meet, each given by its ideal metric coordinates."""
        frame, camera = placed(pose, self._before), self._projection
        seen = np.full(ideal[0].shape, _WALL, np.float32)
        there = [(frame.sheet(sheet), sheet, raster) for sheet, raster in self._sheets]
        for place, sheet, raster in sorted(there, key=lambda each: -float(camera.distance(each[0].middle))):
            if (part := _part(place, sheet, camera)) is not None:
                _draw(place, sheet, raster, camera, ideal, seen, part)
        return seen


def _raster(sheet: Sheet) -> Image:
    """(rows, columns, 2) radiance of each cell, and 1 where there is paper; one cell more on each side, without."""
    radiance = _BLACK + sheet.raster() * (_WHITE - _BLACK)
    return np.pad(np.stack((radiance, np.ones_like(radiance)), axis=-1), ((1, 1), (1, 1), (0, 0))).astype(np.float32)


def _part(place: Placed, sheet: Sheet, camera: Projection) -> tuple[slice, slice] | None:
    """Rows and columns of the picture that may show a sheet; None: it is outside, or seen from behind."""
    if place.axes[:, 2] @ (camera.X0 - place.middle) <= 0.0:
        return None
    half = np.array([sheet.width_mm, sheet.height_mm]) / 2.0 + sheet.margin_mm
    outline = place.middle + (_OUTLINE * half / MM_PER_M) @ place.axes[:, :2].T
    if camera.distance(outline).min() <= 0.0:
        return slice(0, camera.height), slice(0, camera.width)
    x, y = camera.pixels(outline).T
    rows, columns = (
        slice(max(0, int(each.min()) - _SPARE_PX), min(end, int(each.max()) + _SPARE_PX + 1))
        for each, end in ((y, camera.height), (x, camera.width))
    )
    return (rows, columns) if min(rows.stop - rows.start, columns.stop - columns.start) >= 2 else None


def _draw(
    place: Placed, sheet: Sheet, raster: Image, camera: Projection, ideal: tuple[Image, Image], seen: Image,
    part: tuple[slice, slice],
) -> None:  # fmt: skip
    """Draw a sheet over what has been drawn behind it."""
    fine = len(seen) // camera.height
    wide = tuple(slice(each.start * fine, each.stop * fine) for each in part)
    k = camera.R.T @ np.column_stack((place.axes[:, :2], place.middle - camera.X0))
    h = np.linalg.inv(k)  # (right, up, 1) on the sheet, m, up to a factor, from the ray (x, y, -c)
    x, y = (each[wide] for each in ideal)
    right, up, scale = ((row[0] * x + row[1] * y - np.float32(row[2] * camera.c)) for row in h.astype(np.float32))
    rows, columns = raster.shape[:2]
    cell = sheet.cell_mm / MM_PER_M
    # cells count from the raster's upper left corner; OpenCV's places from the middle of the first cell
    across = right / scale * np.float32(1 / cell) + np.float32(columns / 2 - 0.5)
    down = up / scale * np.float32(-1 / cell) + np.float32(rows / 2 - 0.5)
    drawn = cv2.remap(
        raster, _averaged(across, fine), _averaged(down, fine), cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT
    )
    behind = seen[wide]
    behind *= 1.0 - drawn[..., 1]
    behind += drawn[..., 0]


def _averaged(places: Image, fine: int) -> Image:
    """Places at which linear interpolation gives the mean of the cells over what each ray covers.

    Args:
        places: (rows, columns) in cells, 0 the middle of the first one; a ray covers less than a cell.
        fine: rays along a pixel's side.
    """
    covered = np.hypot(*np.gradient(places[::fine, ::fine])) / fine
    covered = cv2.resize(covered, places.shape[::-1], interpolation=cv2.INTER_LINEAR)
    begin = np.floor(places)
    return np.asarray(begin + np.clip((places - begin - 0.5) / covered + 0.5, 0.0, 1.0), np.float32)


def _ideal(camera: Projection) -> Floats:
    """Ideal metric coordinates x, y, (2, rows + 2, columns + 2), of the pixels and of one more on each side."""
    across, down = np.meshgrid(np.arange(-1, camera.width + 1), np.arange(-1, camera.height + 1))
    wanted = np.stack((across - (camera.width - 1) / 2, (camera.height - 1) / 2 - down), axis=-1)
    ideal: Floats = wanted.copy()
    if camera.lens is not None:
        reach = float(np.hypot(camera.width, camera.height))
        for _ in range(_IDEAL_PLACE_STEPS):
            off = wanted - camera.lens.bend(ideal, reach)
            ideal += off
            if np.abs(off).max() < _ENOUGH_PX:
                break
    return np.moveaxis(ideal, -1, 0)


def _rays(ideal: Floats, fine: int) -> tuple[Image, Image]:
    """Ideal metric coordinates x, y, (rows, columns) each, of a grid with `fine` rays along a pixel's side."""
    size = ideal.shape[2] * fine, ideal.shape[1] * fine
    x, y = (
        np.ascontiguousarray(cv2.resize(each, size, interpolation=cv2.INTER_LINEAR)[fine:-fine, fine:-fine], np.float32)
        for each in ideal
    )
    return x, y
