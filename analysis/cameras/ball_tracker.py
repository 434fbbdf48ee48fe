"""Measures how the balls of one camera lie in single frames against its static image: fast, for thousands of frames.

Around each ball the frame is the static image, displaced, with another gain and offset (least squares matching). The
displacements of all balls together are a turn of the camera, much more exact than that of one ball. Balls that
something hides (the jumper, a flake) do not agree with the others, or are no displaced static image at all, and are
left out.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from analysis.cameras.pose_change import FEWEST, Displacements
from analysis.scene.camera_system import PlacedCamera
from analysis.scene.static_image import StaticImage
from rig.arrays import Flags, Floats
from rig.images.picture import Grey

_LARGEST = 16  # px, radius of a ball
_AROUND = 3  # px around a ball that are matched too
_SETTLED_PX = 0.05  # px: a displacement that is predicted so well needs no second step
_STEPS_MOST = 6
_PIXEL_GATE = 3.5  # sigmas at which a pixel is left out
_SHARE = 0.7  # of the pixels of a ball that must agree
_GAIN = (0.3, 3.0)  # of a ball against its static image: outside of that something hides it
_MODEL_SIGMA = 0.02  # px, what matching leaves out of each ball: moving shadows
_COMMON_SIGMA = 0.01  # px, and of all balls alike: sampling, if they move by the same part of a pixel
_BALL_RISK = 1e-3  # chance that a sound ball is left out of a frame
_MOST_LEFT_OUT = 0.5  # share of the balls in sight
_UNKNOWNS = 4
_MARGIN: Final = 2  # px of the template around what is matched, for interpolation and slopes


@dataclass(frozen=True, slots=True, eq=False)
class FrameTurn:
    """How a camera stood in one frame, against its static image.

    Attributes:
        turn: (3,) rad, about the camera's own axes.
        covariance: (3, 3) a posteriori.
        off: (n, 2) displacements of all balls, px; NaN where a ball was not measured or does not agree.
        variance: (n, 2) of them.
    """

    turn: Floats
    covariance: Floats
    off: Floats
    variance: Floats


class BallTracker:
    """The balls of one camera; create it once for a recording.

    Args:
        placed: the camera as it stands in the static image.
        static: its static image.
        balls: by name the coordinates (3,) of balls in sight.
        places: by name where they are in the static image, px.
    """

    def __init__(
        self, placed: PlacedCamera, static: StaticImage, balls: Mapping[str, Floats], places: Mapping[str, Floats]
    ) -> None:
        radius = {name: _radius(static, places[name]) for name in balls}
        half = max((r + _AROUND for r in radius.values()), default=_AROUND) + _MARGIN
        columns, rows = static.size
        pixel = {name: np.rint(places[name][:2]).astype(int) for name in balls}
        inside = {name: half <= x < columns - half and half <= y < rows - half for name, (x, y) in pixel.items()}
        self.names: Final = tuple(name for name in balls if inside[name])
        self._placed = placed
        self._static = static
        self.places: Final = np.array([places[name][:2] for name in self.names], float).reshape(-1, 2)
        self.xyz: Final = np.array([balls[name] for name in self.names], float).reshape(-1, 3)
        self._corner = np.array([pixel[name] for name in self.names], int).reshape(-1, 2) - half
        self._half = half
        size = 2 * half + 1
        cut = [np.s_[y : y + size, x : x + size] for x, y in self._corner]
        self._template = np.array([static.grey[c] for c in cut], float).reshape(-1, size, size)
        # One noise for each ball: that of its border, large if the camera shakes, would pull it to whole pixels.
        noise = np.array([np.median(static.noise[c]) for c in cut], float).reshape(-1, 1, 1)
        m = _MARGIN
        y, x = np.mgrid[-half + m : half - m + 1, -half + m : half - m + 1]
        reach = np.array([radius[name] + _AROUND for name in self.names]).reshape(-1, 1, 1)
        used = x**2 + y**2 <= reach**2
        self._weight = np.where(used, 1 / noise**2, 0.0)
        self.by_turn: Final[Floats] = (
            placed.linearised(self.xyz, placed.project(self.xyz))[2][:, :, 3:6] if self.names else np.empty((0, 2, 3))
        )
        self._last = np.zeros(3)

    def measure(self, frame: Grey) -> FrameTurn | None:
        """Match one frame.

        Args:
            frame: (rows, columns) image.

        Returns:
            None if too few balls can be matched. Frames of one recording are best given in order: each starts where
            the last one was.
        """
        if len(self.names) < FEWEST:
            return None
        found = self._from(frame, self.by_turn @ self._last)
        if found is None:  # the camera jumped, or the frame has nothing to match
            shift, _ = cv2.phaseCorrelate(self._static.grey, frame.astype(np.float32))
            found = self._from(frame, np.broadcast_to(np.array(shift), (len(self.names), 2)))
        if found is not None:
            self._last = found.turn
        return found

    def _from(self, frame: Grey, start: Floats) -> FrameTurn | None:
        """Match from predicted displacements (n, 2)."""
        off = np.array(start, float)
        for _ in range(_STEPS_MOST):
            step, variance, sound = self._matched(frame, off)
            turn, covariance, kept = self._turn(off + step, variance, sound)
            if turn is None:
                return None
            change = np.abs(self.by_turn @ turn - off)[kept].max()
            measured = off + step
            off = self.by_turn @ turn
            if change < _SETTLED_PX:
                break
        else:
            return None
        return FrameTurn(
            turn, covariance, np.where(kept[:, None], measured, np.nan), np.where(kept[:, None], variance, np.nan)
        )

    def _matched(self, frame: Grey, off: Floats) -> tuple[Floats, Floats, Flags]:
        """Steps (n, 2) from the displacements at which the template is taken, variances (n, 2), which are sound."""
        whole = np.rint(off).astype(int)
        template = _displaced(self._template, off - whole)
        m = _MARGIN - 1
        slope_x = (template[:, 1:-1, 2:] - template[:, 1:-1, :-2]) / 2
        slope_y = (template[:, 2:, 1:-1] - template[:, :-2, 1:-1]) / 2
        value = template[:, 1:-1, 1:-1]
        grey, inside = self._windows(frame, whole + self._corner + m + 1, value.shape[1])
        weight = np.where(inside[:, None, None], self._weight, 0.0)
        for again in range(2):
            normal, right = _normal_equations(value, slope_x, slope_y, grey, weight)
            theta = np.linalg.solve(normal, right[..., None])[..., 0]
            fitted = (
                theta[:, 0, None, None] * value
                + theta[:, 1, None, None]
                + theta[:, 2, None, None] * slope_x
                + theta[:, 3, None, None] * slope_y
            )
            squares = weight * (grey - fitted) ** 2
            if not again:
                weight = np.where(squares < _PIXEL_GATE**2, weight, 0.0)
        count = (weight > 0).sum(axis=(1, 2))
        gain = theta[:, 0]
        sound = (count > _SHARE * (self._weight > 0).sum(axis=(1, 2))) & (gain > _GAIN[0]) & (gain < _GAIN[1])
        sound &= inside
        safe = np.where(sound, gain, 1.0)
        cofactors = np.linalg.inv(np.where(sound[:, None, None], normal, np.eye(_UNKNOWNS)))
        factor = np.maximum(1.0, squares.sum(axis=(1, 2)) / np.maximum(1, count - _UNKNOWNS))
        variance = np.diagonal(cofactors, axis1=1, axis2=2)[:, 2:] * (factor / safe**2)[:, None] + _MODEL_SIGMA**2
        return -theta[:, 2:] / safe[:, None], variance, sound

    def _windows(self, frame: Grey, corner: NDArray[np.int_], size: int) -> tuple[Floats, Flags]:
        """Grey values (n, size, size), and which windows lie in the image."""
        rows, columns = frame.shape
        inside = (corner >= 0).all(axis=1) & (corner[:, 0] + size <= columns) & (corner[:, 1] + size <= rows)
        x, y = np.where(inside[:, None], corner, 0).T
        span = np.arange(size)
        grey = frame[y[:, None, None] + span[:, None], x[:, None, None] + span]
        return grey.astype(float), np.asarray(inside)

    def _turn(self, off: Floats, variance: Floats, sound: Flags) -> tuple[Floats | None, Floats, Flags]:
        """The turn that most balls agree on: without the worst, as long as one is too bad."""
        kept = sound.copy()
        gate = float(chdtri(2, _BALL_RISK / max(1, int(sound.sum()))))
        fewest = max(FEWEST, int(np.ceil((1 - _MOST_LEFT_OUT) * sound.sum())))
        while kept.sum() >= fewest:
            b, w = self.by_turn[kept], 1 / variance[kept]
            normal = np.einsum("nia,ni,nib->ab", b, w, b)
            turn = np.linalg.solve(normal, np.einsum("nia,ni,ni->a", b, w, off[kept]))
            squares = ((off - self.by_turn @ turn) ** 2 / variance).sum(axis=1)
            factor = max(1.0, float(squares[kept].sum()) / max(1, 2 * int(kept.sum()) - 3))
            inside = np.flatnonzero(kept)
            worst = inside[int(squares[inside].argmax())]
            if squares[worst] < gate:
                common = (_COMMON_SIGMA / self._placed.camera.interior[0]) ** 2 * np.eye(3)
                return turn, np.linalg.inv(normal) * factor + common, kept
            kept[worst] = False
        return None, np.zeros((3, 3)), kept

    def displaced(self, off: Floats, variance: Floats) -> Displacements:
        """Displacements (n, 2) from the static image with their variances (n, 2); those that are NaN are left out."""
        good = np.asarray(np.isfinite(off).all(axis=1))
        names = tuple(name for name, ok in zip(self.names, good, strict=True) if ok)
        covariance = variance[good][:, :, None] * np.eye(2)
        return Displacements(names, self.xyz[good], self.places[good], self.places[good] + off[good], covariance)


def _radius(static: StaticImage, place: Floats) -> int:
    """Radius of the ball at a place, px: where the grey value changes most from ring to ring."""
    columns, rows = static.size
    x0, y0 = round(float(place[0])), round(float(place[1]))
    y, x = np.mgrid[max(0, y0 - _LARGEST) : min(rows, y0 + _LARGEST + 1), max(0, x0 - _LARGEST) : x0 + _LARGEST + 1]
    x, y = x[x < columns], y[x < columns]
    ring = np.rint(np.hypot(x - place[0], y - place[1])).astype(int)
    grey = np.bincount(ring, static.grey[y, x]) / np.maximum(1, np.bincount(ring))
    return 1 + int(np.abs(np.diff(grey[:_LARGEST])).argmax())


def _displaced(template: Floats, off: Floats) -> Floats:
    """Templates (n, s, s) displaced by parts of a pixel (n, 2), cubic, (n, s - 2, s - 2): the border is lost."""
    fractions = np.arange(-1, 3)[None]
    s = template.shape[1]
    result = template
    for axis, part in ((2, off[:, 0]), (1, off[:, 1])):
        # value at x - part: between x - part rounded down and the next one
        floor = np.floor(-part).astype(int)
        t = -part - floor
        taps = (
            np.stack((-(t**3) + 2 * t**2 - t, 3 * t**3 - 5 * t**2 + 2, -3 * t**3 + 4 * t**2 + t, t**3 - t**2), axis=1)
            / 2
        )
        places = np.arange(s)[None, :, None] + floor[:, None, None] + fractions[:, None]
        np.clip(places, 0, s - 1, out=places)
        moved = np.zeros_like(result)
        rows = np.arange(len(result))[:, None]
        for k in range(4):
            picked = result[rows, :, places[:, :, k]].transpose(0, 2, 1) if axis == 2 else result[rows, places[:, :, k]]
            moved = moved + taps[:, k, None, None] * picked
        result = moved
    return np.asarray(result[:, 1:-1, 1:-1])


def _normal_equations(
    value: Floats, slope_x: Floats, slope_y: Floats, grey: Floats, weight: Floats
) -> tuple[Floats, Floats]:
    """Of gain, offset, and displacements times gain, per ball: (n, 4, 4) and (n, 4)."""
    n = len(value)
    design = np.stack((value, np.ones_like(value), slope_x, slope_y), axis=1).reshape(n, _UNKNOWNS, -1)
    weighted = design * weight.reshape(n, 1, -1)
    normal = weighted @ design.transpose(0, 2, 1) + 1e-9 * np.eye(_UNKNOWNS)  # of a covered ball it is singular
    right = (weighted @ grey.reshape(n, -1, 1))[..., 0]
    return normal.astype(float), right.astype(float)
