"""Draws pictures of printed targets for tests, by ray: written from the contract's equations, none of our code's.

Rays of a grid finer than the pixels meet planes with targets; then come blur, the mean over each pixel, and noise.
"""

from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RectBivariateSpline

Array = NDArray[np.float64]
UNITS: Final = 24  # raster cells along a square: its marker begins after 5 of them, and each field has 2
_DARK, _BRIGHT, _BEHIND = 30.0, 210.0, 120.0
_FINE: Final = 4  # rays along a pixel's side
_FINER: Final = 4  # raster cells of targets with circles for one of the others
#: What a corner reaches that is computed: nothing is bent within it.
EXACT: Final = ((1e-3, 0.0), (0.0, 1e-3))
_STRIP: Final = 32_000  # rays that are computed at a time, in whole rows: their arrays stay in the processor's cache


@dataclass(frozen=True)
class DrawnCamera:
    """A camera; parameters as `svev-network/1` defines them (projected distortion, unbalanced)."""

    size: tuple[int, int] = (640, 480)
    c: float = 800.0
    x0: float = 0.0
    y0: float = 0.0
    a1: float = 0.0
    a2: float = 0.0
    b1: float = 0.0
    b2: float = 0.0

    def distorted(self, x: Array, y: Array) -> tuple[Array, Array]:
        r2 = x * x + y * y
        radial = self.a1 * r2 + self.a2 * r2 * r2
        return (
            x + x * radial + self.b1 * (r2 + 2 * x * x) + 2 * self.b2 * x * y + self.x0,
            y + y * radial + self.b2 * (r2 + 2 * y * y) + 2 * self.b1 * x * y + self.y0,
        )

    @cached_property
    def rays(self) -> tuple[Array, Array]:
        """Ideal metric coordinates of the fine grid: (rows, columns) each."""
        width, height = self.size
        coarse_x, coarse_y = np.linspace(-1, width, width // 8 + 1), np.linspace(-1, height, height // 8 + 1)
        wanted_x, wanted_y = np.meshgrid(coarse_x - (width - 1) / 2, (height - 1) / 2 - coarse_y)
        x, y = wanted_x - self.x0, wanted_y - self.y0
        for _ in range(50):
            there_x, there_y = self.distorted(x, y)
            x, y = x + (wanted_x - there_x), y + (wanted_y - there_y)
        fine = [(np.arange(n * _FINE) + 0.5) / _FINE - 0.5 for n in (width, height)]
        ideal_x, ideal_y = (RectBivariateSpline(coarse_y, coarse_x, each)(fine[1], fine[0]) for each in (x, y))
        return ideal_x.astype(np.float32), ideal_y.astype(np.float32)

    @cached_property
    def extents(self) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        """Least and greatest ideal x of each column of the fine grid, and y of each row."""
        x, y = self.rays
        return (x.min(axis=0), x.max(axis=0)), (y.min(axis=1), y.max(axis=1))


@dataclass(frozen=True)
class Sheet:
    """A plane with a raster of grey values.

    Attributes:
        raster: (rows, columns), -1 where it has been cut away.
        cell: mm, side of a raster cell.
        units: raster cells along a square.
        place: (3,) mm, of the middle.
        axes: (3, 3), columns: to the right, upwards, towards the reader.
    """

    raster: NDArray[np.float32]
    cell: float
    place: Array
    axes: Array
    units: int = UNITS


def board_raster(columns: int = 9, rows: int = 6) -> NDArray[np.float32]:
    """OpenCV's own picture of the board, so that the test knows that ours is one of OpenCV."""
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_250)
    board = cv2.aruco.CharucoBoard((columns, rows), UNITS, 14, dictionary)
    drawn = board.generateImage((columns * UNITS, rows * UNITS), marginSize=0)
    shades = np.where(drawn > 127, _BRIGHT, _DARK).astype(np.float32)
    return np.pad(shades, UNITS // 2, constant_values=_BRIGHT)


def single_raster(code: int) -> NDArray[np.float32]:
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_5X5_250)
    raster = np.full((40, 40), _BRIGHT, np.float32)
    square = slice(8, 8 + UNITS)
    for side in (slice(1, 8), slice(32, 39)):
        raster[side, square] = raster[square, side] = _DARK
    fields = np.kron(cv2.aruco.generateImageMarker(dictionary, code, 7), np.ones((2, 2)))
    raster[13:27, 13:27] = np.where(fields > 127, _BRIGHT, _DARK)
    return raster


def circles_raster(code: int) -> NDArray[np.float32]:
    """A target with discs of an eighth of the square's side about its corners; four cells where the others have one."""
    raster = np.kron(single_raster(code), np.ones((_FINER, _FINER), np.float32))
    inside = slice(12 * _FINER, 28 * _FINER)
    shades = _discs().copy()
    shades[inside, inside] = raster[inside, inside]
    return shades


@cache
def _discs() -> NDArray[np.float32]:
    """The discs of all targets with circles, on white."""
    size = 40 * _FINER
    shades = np.full((size, size), _BRIGHT, np.float32)
    parts = 8  # along a cell's side, of which each is within the disc or outside
    fine = (np.arange(size * parts) + 0.5) / (_FINER * parts)
    for row in (8.0, 32.0):
        for column in (8.0, 32.0):
            disc = ((fine - row) ** 2)[:, None] + ((fine - column) ** 2)[None] < (UNITS / 8.0) ** 2
            share = disc.reshape(size, parts, size, parts).mean(axis=(1, 3))
            shades += (share * (_DARK - _BRIGHT)).astype(np.float32)
    return shades


def looking(at: Array, away: float, *, along: float, up: float, roll: float) -> tuple[Array, Array]:
    """Position and rotation (columns: the camera's axes) of a camera; angles in degrees, seen from +Z of the object."""
    a, b, r = np.radians([along, up, roll])
    back = np.array([np.sin(a) * np.cos(b), np.sin(b), np.cos(a) * np.cos(b)])
    right = np.cross([0.0, 1.0, 0.0], back)
    right /= np.linalg.norm(right)
    above = np.cross(back, right)
    turned = np.column_stack((np.cos(r) * right + np.sin(r) * above, np.cos(r) * above - np.sin(r) * right, back))
    return at + away * back, turned


@dataclass(frozen=True)
class Drawing:
    """How pictures are taken; noise in levels of eight bits, blur in px, the light that is lost at half the width."""

    camera: DrawnCamera
    noise: float = 2.0
    blur: float = 0.7
    falloff: float = 0.0
    random: np.random.Generator = field(default_factory=lambda: np.random.default_rng(1))

    def picture(self, sheets: list[Sheet], position: Array, rotation: Array) -> NDArray[np.uint8]:
        """(rows, columns) what the camera sees."""
        shape = self.camera.rays[0].shape
        fine = np.full(shape, _BEHIND, np.float32)
        nearest = np.full(shape, np.inf, np.float32)
        for sheet in sheets:
            _draw(sheet, self.camera, position, rotation, fine, nearest)
        blurred = cv2.GaussianBlur(fine, (0, 0), self.blur * _FINE) if self.blur else fine
        width, height = self.camera.size
        grey = cv2.resize(blurred, (width, height), interpolation=cv2.INTER_AREA)
        along, down = np.meshgrid(*((np.arange(n) - (n - 1) / 2) / (width / 2) for n in (width, height)))
        grey *= (1.0 - self.falloff * (along**2 + down**2)).astype(np.float32)
        noisy = grey + self.random.normal(0.0, self.noise, grey.shape)
        return np.asarray(np.clip(np.rint(noisy), 0, 255), np.uint8)


def _draw(
    sheet: Sheet, camera: DrawnCamera, position: Array, rotation: Array,
    fine: NDArray[np.float32], nearest: NDArray[np.float32],
) -> None:  # fmt: skip
    right, above, towards = sheet.axes.T
    rows, columns = sheet.raster.shape
    half = np.array([columns, rows]) * sheet.cell / 2
    if towards @ (position - sheet.place) <= 0:
        return  # seen from behind
    outline = [sheet.place + i * half[0] * right + j * half[1] * above for i in (-1, 1) for j in (-1, 1)]
    k = (np.array(outline) - position) @ rotation
    if np.any(k[:, 2] > -1.0):
        raise ValueError("a sheet reaches behind the camera")
    ideal = -camera.c * k[:, :2] / k[:, 2:]
    column, row = (
        np.flatnonzero((least < places.max()) & (most > places.min()))
        for (least, most), places in zip(camera.extents, ideal.T, strict=True)
    )
    if min(len(row), len(column)) < 2:
        return
    # direction (x, y, -c) in the camera system; plain numbers keep single precision, which is exact to 10^-4 cells
    into = [(rotation.T @ axis).tolist() for axis in (right, above, towards)]
    start = position - sheet.place
    c, u0, v0, depth = float(camera.c), float(right @ start), float(above @ start), float(-towards @ start)
    end, height = int(row[-1]) + 1, max(_STRIP // len(column), 1)
    padded = np.pad(sheet.raster, 1, mode="edge")
    for top in range(int(row[0]), end, height):
        bottom = min(top + height, end)
        first, last = max(top - 1, int(row[0])), min(bottom + 1, end)  # the slope of a row needs its neighbours
        wide = np.s_[first:last, column[0] : column[-1] + 1]
        x, y = camera.rays[0][wide], camera.rays[1][wide]
        scale = depth / (into[2][0] * x + into[2][1] * y - into[2][2] * c)
        u = u0 + scale * (into[0][0] * x + into[0][1] * y - into[0][2] * c)
        v = v0 + scale * (into[1][0] * x + into[1][1] * y - into[1][2] * c)
        across, down = (u + float(half[0])) / sheet.cell, (float(half[1]) - v) / sheet.cell
        within = (
            (down >= 0) & (down < rows) & (across >= 0) & (across < columns) & (scale > 0) & (scale < nearest[wide])
        )
        within[: top - first] = within[bottom - first :] = False
        fine[wide][within] = _mean_shade(padded, across, down, within)
        nearest[wide][within] = scale[within]


def _mean_shade(padded: NDArray[np.float32], across: Array, down: Array, wanted: NDArray[np.bool_]) -> Array:
    """The mean of the raster over the footprint of each ray that is wanted, in their order; places in cells.

    A footprint is smaller than a cell. The raster is padded by a cell on each side.
    """
    columns = padded.shape[1]
    shares, cells = [], np.full(np.count_nonzero(wanted), columns + 1, np.intp)
    for places, step in ((down, columns), (across, 1)):
        along, over = np.gradient(places)
        footprint = np.sqrt(along * along + over * over)[wanted]
        seen = places[wanted]
        begin = np.floor(seen - 0.5)
        shares.append(np.clip((seen - 0.5 - begin - 0.5) / footprint + 0.5, 0.0, 1.0))
        cells += begin.astype(np.intp) * step
    s, t = shares
    shades = padded.ravel()
    upper = (1 - t) * shades[cells] + t * shades[cells + 1]
    lower = (1 - t) * shades[cells + columns] + t * shades[cells + columns + 1]
    return np.asarray((1 - s) * upper + s * lower)


def board_sheet(square_mm: float = 30.0) -> Sheet:
    return Sheet(board_raster(), square_mm / UNITS, np.zeros(3), np.eye(3))


def frame_sheets(
    count: int = 16, target_mm: float = 80.0, step: float = 150.0, *, circles: bool = False
) -> list[Sheet]:
    """A 3D frame: targets at four depths, `step` mm apart, turned a little, all seen from +Z."""
    sheets = []
    side = int(np.ceil(np.sqrt(count)))
    random = np.random.default_rng(5)
    for n in range(count):
        row, column = divmod(n, side)
        place = np.array([(column - (side - 1) / 2) * 260.0, (row - (side - 1) / 2) * 260.0, -step * (n * 7 % 4)])
        _, axes = looking(
            place, 1.0, along=random.uniform(-15, 15), up=random.uniform(-15, 15), roll=random.uniform(-20, 20)
        )
        if circles:
            units = UNITS * _FINER
            sheets.append(Sheet(circles_raster(175 + n), target_mm / units, place, axes, units))
        else:
            sheets.append(Sheet(single_raster(100 + n), target_mm / UNITS, place, axes))
    return sheets


def stations(at: Array, away: float, random: np.random.Generator, count: int = 12) -> list[tuple[Array, Array]]:
    """Poses from all sides; half of them are rolled by 90 degrees."""
    poses = []
    for n in range(count):
        angle = 2 * np.pi * n / count
        tilt = (35.0, 20.0, 10.0)[n % 3]
        off = random.uniform(-1, 1, 3) * 0.06 * away
        along, up = tilt * np.cos(angle), tilt * np.sin(angle)
        roll = (0.0, 90.0, 180.0, 270.0)[n % 4] + random.uniform(-5, 5)
        poses.append(looking(at + off, away * random.uniform(0.85, 1.1), along=along, up=up, roll=roll))
    return poses


def corner_places(sheets: list[Sheet]) -> dict[str, Array]:
    """Where the corners are, by the names that Svev gives them: a board alone, or single targets from 100 on.

    Those with circles are from 175 on.
    """
    if len(sheets) == 1:
        cell = sheets[0].cell * UNITS
        return {
            f"B{y}-{x}": np.array([(x - 4.5) * cell, (3 - y) * cell, 0.0]) for y in range(1, 6) for x in range(1, 9)
        }
    places = {}
    for n, sheet in enumerate(sheets):
        half = sheet.cell * sheet.units / 2
        first = 100 if sheet.units == UNITS else 175
        for letter, (u, v) in zip("abcd", ((-half, half), (half, half), (half, -half), (-half, -half)), strict=True):
            places[f"T{first + n}{letter}"] = sheet.place + sheet.axes[:, 0] * u + sheet.axes[:, 1] * v
    return places


def seen_at(camera: DrawnCamera, position: Array, rotation: Array, places: dict[str, Array]) -> dict[str, Array]:
    """(2,) px, pixel frame, where a camera shows places, of those within its picture."""
    width, height = camera.size
    seen = {}
    for name, place in places.items():
        k = rotation.T @ (place - position)
        x, y = camera.distorted(*(-camera.c * k[:2] / k[2]))
        at = np.array([x + (width - 1) / 2, (height - 1) / 2 - y])
        if k[2] < 0 and np.all(at > -0.5) and np.all(at < np.array(camera.size) - 0.5):
            seen[name] = at
    return seen
