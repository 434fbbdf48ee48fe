"""Seeks the directions of both skis through the pulses, from the places of their bindings alone.

In one image a ski is a line of one grey value B before the static scene, which begins at the binding and goes to both
sides. Along each line through the binding, at each distance beside it, a pixel of the axis has the grey value g with
the probability

    p_ski(g) = 0.75 N(g; B, noise^2 + (m B')^2) + 0.15 N(g; S, noise^2) + 0.10 / 200,

with the static scene S and the contrast B' = |B - S|: it shows the ski, or the scene, or something else in front of it.
A pixel beside the ski shows the scene, or something else. The logarithm of these against those of any pixel is summed
along each line. A direction in space has the sum over the images of the lines that it makes there. Over time skis turn
slowly: the path with the largest sum of all pulses is found (Viterbi), at first among directions 4 degrees apart, then
among those around it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from analysis.ski_bars.bars import SKIS, USUAL_SHAPE
from analysis.ski_bars.model import BOOT_M, SHOVEL_M
from analysis.ski_bars.pixels import SkiView, to_piece
from rig.arrays import Flags, Floats, Integers, Reals

#: Slope and heading of a ski against the flight, rad, standard deviations, and how far from it they are sought: no ski
#: is steeper before the landing.
SLOPE_SIGMA, HEADING_SIGMA = np.radians(25.0), np.radians(15.0)
FARTHEST_RAD: Final = (np.radians(45.0), np.radians(36.0))
#: The left ski against the right one, rad: standard deviation of the slope, mean and standard deviation of the heading.
SLOPES_APART, OPENING, OPENING_SIGMA = np.radians(8.0), np.radians(15.0), np.radians(15.0)
_COARSE, _FINE = np.radians(4.0), np.radians(1.0)
_AROUND: Final = 5  # fine steps to each side of the coarse direction
_TURNS: Final = 0.6  # of the steps of the directions: those of the lines in an image
SLOPE_RAD_S, HEADING_RAD_S = 1.5, 0.6  #: how fast skis turn
#: Lines are tried up to so many standard deviations beside a binding, in such steps; and what is so far from a line is
#: beside the ski, m.
_ASIDE_SIGMAS, _STEP_M, _BESIDE_M = 1.8, 0.03, 0.09
_ASIDE_SIGMA_M: Final = 0.05  # of the axis from a binding's marker, across it
SHARP_M: Final = 0.1  #: standard deviation of a binding from which on it is known vaguely alone
_TAKEN_M, _TAKEN_PX = 0.05, 2.0  # half the width of what another ski explains: itself, and the blur
_REACH_M: Final = (-1.28, 1.52)
_ALONG_M: Final = 0.08
_ALIKE_PX: Final = 8.0  # along a ski, over which errors of the model are alike
_MODEL, _ROUGH = 0.1, 2.0  # error of the model in proportion to the contrast, and in any case, grey values
_ANYTHING: Final = 1 / 200  # density of the grey value of something else
_ON_SKI, _THROUGH, _COVERED = 0.75, 0.15, 0.10
_FREE: Final = 0.85  # share of the pixels beside a ski that show the scene


@dataclass(frozen=True, slots=True, eq=False)
class Directions:
    """Directions of both skis.

    Attributes:
        direction: (t, 2, 3) unit vectors from tail to tip.
        gain: (t, 2) how much likelier than no ski, natural logarithm; 0 where it was not sought.
    """

    direction: Floats
    gain: Floats


def seek_directions(
    pulses: Sequence[Sequence[SkiView]],
    bindings: Floats,
    covariance: Floats,
    known: Flags,
    time_s: Floats,
    axes: Floats,
) -> Directions:
    """Seek the directions of both skis.

    Args:
        pulses: what the cameras show at t pulses.
        bindings: (t, 2, 3) m.
        covariance: (t, 2, 3, 3) of them, m^2. One that is vague is sought beside the ski of the other one: what shows
            that ski tells nothing of it.
        known: (t, 2) where a binding is known, perhaps vaguely.
        time_s: (t,) of the pulses.
        axes: (3, 3) forward, left and up as rows.
    """
    sharp = known & is_sharp(covariance)
    slope, heading = (np.arange(-round(most / _COARSE), round(most / _COARSE) + 1) * _COARSE for most in FARTHEST_RAD)
    prior = -0.5 * ((slope[:, None] / SLOPE_SIGMA) ** 2 + (heading / HEADING_SIGMA) ** 2)
    around = np.arange(-_AROUND, _AROUND + 1) * _FINE
    beside = -0.5 * (np.hypot(around[:, None], around) / _COARSE) ** 2
    coarse = directions(slope, heading, axes)
    direction, gain = np.zeros((len(pulses), SKIS, 3)), np.zeros((len(pulses), SKIS))
    scores = np.zeros((SKIS, len(pulses), len(slope), len(heading)))
    paths = np.zeros((SKIS, len(pulses), 2), int)

    def place(t: int, k: int) -> _Place:
        other = 1 - k
        explained = sharp[t, other] and not sharp[t, k]
        taken = (bindings[t, other], direction[t, other]) if explained else None
        return _Place(pulses[t], bindings[t, k], covariance[t, k], taken)

    for wanted in (sharp, known & ~sharp):
        if not wanted.any():
            continue
        for k, t in zip(*np.nonzero(wanted.T), strict=True):
            scores[k, t] = prior + place(t, k).scores(coarse, _COARSE)
        paths = _both(scores, sharp | wanted, time_s, slope, heading)
        for k, t in zip(*np.nonzero(wanted.T), strict=True):
            fine = directions(slope[paths[k, t, 0]] + around, heading[paths[k, t, 1]] + around, axes)
            score = place(t, k).scores(fine, _FINE)
            gain[t, k] = score.max()
            weight = np.exp(score - gain[t, k] + beside)
            steps = np.meshgrid(around, around, indexing="ij")
            mean = np.array([(weight * part).sum() for part in steps]) / weight.sum()
            turned = slope[paths[k, t, :1]] + mean[0], heading[paths[k, t, 1:]] + mean[1]
            direction[t, k] = directions(*turned, axes)[0, 0]
    return Directions(direction, gain)


def is_sharp(covariance: Floats) -> Flags:
    """Whether places with covariances (..., 3, 3) are known so well that lines are sought there alone."""
    return np.asarray(np.linalg.eigvalsh(covariance)[..., -1] < SHARP_M**2)


def _both(scores: Floats, known: Flags, time_s: Floats, slope: Floats, heading: Floats) -> Integers:
    """Indices (2, t, 2) of slope and heading of both skis on their likeliest paths, each beside the other one."""
    paths = np.zeros((SKIS, len(time_s), 2), int)
    alone = np.zeros(SKIS)
    for k in range(SKIS):
        if known[:, k].any():
            paths[k, known[:, k]], alone[k] = _likeliest(scores[k, known[:, k]], time_s[known[:, k]], slope, heading)
    for k in np.argsort(alone).tolist():
        other, both = 1 - k, known.all(axis=1)
        if not both.any():
            continue
        beside = scores[k].copy()
        at = paths[other, both]
        opening = (heading - heading[at[:, 1], None]) * (1 if k else -1) - OPENING
        beside[both] -= 0.5 * ((slope - slope[at[:, 0], None]) / SLOPES_APART)[:, :, None] ** 2
        beside[both] -= 0.5 * (opening / OPENING_SIGMA)[:, None] ** 2
        paths[k, known[:, k]], _ = _likeliest(beside[known[:, k]], time_s[known[:, k]], slope, heading)
    return paths


def directions(slope: Floats, heading: Floats, axes: Floats) -> Floats:
    """Unit vectors (s, h, 3) of all slopes (s,) with all headings (h,)."""
    a, b = slope[:, None], heading[None]
    return np.stack((np.cos(a) * np.cos(b), np.cos(a) * np.sin(b), np.sin(a) + 0 * b), axis=-1) @ axes


def _likeliest(scores: Floats, time_s: Floats, slope: Floats, heading: Floats) -> tuple[list[tuple[int, int]], float]:
    """The path of the largest sum of scores (t, s, h) and of the logarithms of the turns' densities (Viterbi)."""
    best, before = scores[0], []
    for score, dt in zip(scores[1:], np.diff(time_s), strict=True):
        turned = [
            -((angle[:, None] - angle) ** 2) / (2 * ((rate * dt) ** 2 + (_COARSE / 2) ** 2))
            for angle, rate in ((slope, SLOPE_RAD_S), (heading, HEADING_RAD_S))
        ]
        by_slope = best[None] + turned[0][:, :, None]
        by_heading = by_slope.max(axis=1)[:, None] + turned[1]
        from_heading = by_heading.argmax(axis=2)
        before.append((np.take_along_axis(by_slope.argmax(axis=1), from_heading, axis=1), from_heading))
        best = by_heading.max(axis=2) + score
    i, j = np.unravel_index(int(best.argmax()), best.shape)
    path = [(int(i), int(j))]
    for from_slope, from_heading in reversed(before):
        at = path[-1]
        path.append((int(from_slope[at]), int(from_heading[at])))
    return path[::-1], float(best.max())


@dataclass(frozen=True, slots=True, eq=False)
class _Place:
    """Where a binding is.

    Attributes:
        views: images of the pulse.
        xyz: (3,) m.
        covariance: (3, 3) m^2.
        taken: place (3,) and direction (3,) of the other ski, where that explains what is seen.
    """

    views: Sequence[SkiView]
    xyz: Floats
    covariance: Floats
    taken: tuple[Floats, Floats] | None

    def scores(self, directions: Floats, step: float) -> Floats:
        """How much likelier than no ski directions (s, h, 3), `step` apart, are by all images: logarithms (s, h)."""
        total = np.zeros(directions.shape[:2])
        ends = np.array(USUAL_SHAPE[1:])
        vague = 0.0 if is_sharp(self.covariance) else float(np.linalg.eigvalsh(self.covariance)[-1])
        sigma_m = float(np.sqrt(_ASIDE_SIGMA_M**2 + vague))
        for view in self.views:
            place = self.xyz + view.shift
            xy = view.camera.project(place)
            px = view.camera.project(place + ends[:, None, None, None] * directions)
            scale = float(view.camera.camera.interior[0] / np.linalg.norm(place - view.camera.position))
            if not (np.isfinite(px).all() and np.isfinite(xy).all()):
                continue
            chord = px[1] - px[0]
            turn = np.arctan2(chord[..., 1], chord[..., 0])
            middle = np.angle(np.exp(2j * turn).sum()) / 2
            # a line has the same sums from both ends
            off = (turn - middle + np.pi / 2) % np.pi - np.pi / 2
            turns = np.arange(off.min(), off.max() + _TURNS * step, _TURNS * step)
            lines = _line_sums(view, _Bundle(xy, scale, middle + turns, min(_STEP_M, step), sigma_m), self.taken)
            if lines is None:
                continue
            sums, aside = lines
            i = np.clip(np.rint((off - turns[0]) / (_TURNS * step)).astype(int), 0, len(turns) - 1)
            unit = np.stack((np.cos(middle + off), np.sin(middle + off)), axis=-1)
            reach = np.sort(((px - xy) * unit).sum(axis=-1) / scale, axis=0)
            first, last = (
                np.clip(np.rint((r - _REACH_M[0]) / _ALONG_M).astype(int), 0, sums.shape[2] - 1) for r in reach
            )
            total += (sums[i, :, last] - sums[i, :, first] + aside).max(axis=-1)
        return total


@dataclass(frozen=True, slots=True, eq=False)
class _Bundle:
    """Lines of an image through a binding, and beside it.

    Attributes:
        xy: (2,) the binding, px.
        scale: px per m.
        turns: (n,) of the lines against the x axis, rad.
        step_m: between lines side by side.
        sigma_m: how far beside the binding the axis may be, standard deviation.
    """

    xy: Floats
    scale: float
    turns: Floats
    step_m: float
    sigma_m: float


@dataclass(frozen=True, slots=True, eq=False)
class LineTable:
    """What the lines around a place tell in an image.

    Attributes:
        xy: (2,) the place, px.
        scale: px per m.
        turns: (n,) of the lines, rad, over half a turn in equal steps.
        sums: (n, lines side by side, samples + 1) logarithms, from the first sample of a line to each.
    """

    xy: Floats
    scale: float
    turns: Floats
    sums: Floats

    def nearest(self, turn: Floats) -> tuple[Integers, Floats]:
        """The nearest turns (k,) of lines at angles (k,), and their unit vectors (k, 2)."""
        i = np.rint((turn - self.turns[0]) / (self.turns[1] - self.turns[0])).astype(int) % len(self.turns)
        at = self.turns[i]
        return i, np.stack((np.cos(at), np.sin(at)), axis=-1)

    def between(self, turn: Integers, u: Floats, first: Floats, last: Floats) -> tuple[Floats, Flags]:
        """Sums from `first` to `last` (..., px along) of the best of three lines at u px beside the place.

        Returns:
            Sums (...), and whether the lines were looked at (...).
        """
        beside, samples = self.sums.shape[1:]
        line = np.rint(u / (_STEP_M * self.scale)).astype(int) + (beside - 1) // 2
        inside: Flags = (line >= 1) & (line < beside - 1)
        row = (turn * beside + np.clip(line, 1, beside - 2)) * samples
        begin, end = (
            row + np.clip(np.rint((r / self.scale - _REACH_M[0]) / _ALONG_M).astype(int), 0, samples - 1)
            for r in (first, last)
        )
        flat = self.sums.ravel()  # by one number a place is found faster than by three
        one, middle, other = (flat.take(end + i) - flat.take(begin + i) for i in (-samples, 0, samples))
        return np.maximum(np.maximum(one, middle), other), inside


def line_table(
    view: SkiView, place: Floats, step: float, reach_m: float, taken: tuple[Floats, Floats] | None
) -> LineTable | None:
    """Lines of all turns through a place and beside it; None where the image does not show it.

    Args:
        view: of a camera.
        place: (3,) m, as the camera saw it.
        step: between directions in space, rad.
        reach_m: how far beside the place lines are looked at.
        taken: as of `_Place`.
    """
    xy = view.camera.project(place)
    if not np.isfinite(xy).all():
        return None
    scale = float(view.camera.camera.interior[0] / np.linalg.norm(place - view.camera.position))
    turns = np.pi * np.arange(n := int(np.ceil(np.pi / (_TURNS * step)))) / n
    lines = _line_sums(view, _Bundle(xy, scale, turns, _STEP_M, reach_m / _ASIDE_SIGMAS), taken)
    return None if lines is None else LineTable(xy, scale, turns, lines[0])


def _line_sums(view: SkiView, lines: _Bundle, taken: tuple[Floats, Floats] | None) -> tuple[Floats, Floats] | None:
    """Sums along lines around a binding, from their first sample to each; None outside of the image.

    Args:
        view: of a camera.
        lines: that are looked at.
        taken: as of `_Place`.

    Returns:
        Sums (n, lines side by side, samples + 1), and the logarithm of the density of lines beside the binding.
    """
    xy, scale, turns, step_m = lines.xy, lines.scale, lines.turns, lines.step_m
    side, beside = round(_ASIDE_SIGMAS * lines.sigma_m / step_m), round(_BESIDE_M / step_m)
    reach = int(np.ceil((max(_REACH_M) + (side + beside) * step_m) * scale)) + 2
    region = view.part(np.floor(xy).astype(int) - reach, np.ceil(xy).astype(int) + reach + 1)
    if region is None:
        return None
    u = np.asarray(np.arange(-side - beside, side + beside + 1) * step_m * scale, float)
    r = np.arange(_REACH_M[0], _REACH_M[1], _ALONG_M)
    on, shape = slice(beside, beside + 2 * side + 1), (len(turns), len(u), len(r))
    cosine, sine = np.cos(turns)[:, None, None], np.sin(turns)[:, None, None]
    # Pixels are 32 bits wide: they are noisier than that.
    x = (xy[0] - region.x + cosine * (r * scale) - sine * u[:, None]).reshape(len(turns), -1).astype(np.float32)
    y = (xy[1] - region.y + sine * (r * scale) + cosine * u[:, None]).reshape(len(turns), -1).astype(np.float32)
    grey, behind, sigma = (
        np.asarray(cv2.remap(layer, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE), np.float32)
        for layer in (region.grey, region.behind, region.sigma)
    )
    grey, behind, variance = grey.reshape(shape), behind.reshape(shape), (sigma * sigma).reshape(shape)
    inside = (x >= 0) & (x <= region.grey.shape[1] - 1) & (y >= 0) & (y <= region.grey.shape[0] - 1)
    inside = inside.reshape(shape)
    if len(view.legs.ends) or taken is not None:
        places = (x + np.float32(region.x)).reshape(shape), (y + np.float32(region.y)).reshape(shape)
        inside &= ~view.on_legs(*places)
        if taken is not None:
            ends = taken[0] + np.array(USUAL_SHAPE[1:])[:, None] * taken[1] + view.shift
            inside &= to_piece(*places, view.camera.project(ends)) > _TAKEN_M * scale + _TAKEN_PX
    scene = _density(grey - behind, variance)
    nothing = np.log(0.5 * scene + 0.5 * _ANYTHING)
    free = np.where(inside, np.log(_FREE * scene + (1 - _FREE) * _ANYTHING) - nothing, 0.0)
    arms = (np.abs(r) > BOOT_M) & (np.abs(r) < SHOVEL_M)
    gain = _as_ski(grey[:, on], behind[:, on], variance[:, on], scene[:, on], arms, r) - nothing[:, on]
    gain += 0.5 * (free[:, : 2 * side + 1] + free[:, 2 * beside :])
    gain[~inside[:, on] | (np.abs(r) < BOOT_M)] = 0.0
    alike = min(1.0, _ALONG_M * scale / _ALIKE_PX)
    aside = np.asarray(-0.5 * (u[on] / (lines.sigma_m * scale)) ** 2, float)
    return np.concatenate((np.zeros((*gain.shape[:2], 1)), alike * np.cumsum(gain, axis=-1)), axis=-1), aside


def _as_ski(grey: Reals, behind: Reals, variance: Reals, scene: Reals, arms: Flags, r: Floats) -> Reals:
    """Densities of pixels (..., n) of lines that a ski lies on, logarithms.

    How bright the ski is tells its whole length or its half near the binding, whichever fits better: a ski that leads
    towards a camera is short in the image.

    Args:
        grey: values.
        behind: of the static scene.
        variance: of the noise.
        scene: densities of the pixels, if they show the static scene.
        arms: (n,) where the ski is, but for boot and shovel.
        r: (n,) m along the lines.
    """

    def with_brightness_of(part: Flags) -> Reals:
        bright = np.median(grey[..., part], axis=-1, keepdims=True)
        misfit = variance + (_MODEL * (bright - behind)) ** 2 + _ROUGH**2
        return np.asarray(np.log(_ON_SKI * _density(grey - bright, misfit) + _THROUGH * scene + _COVERED * _ANYTHING))

    whole, near = (with_brightness_of(of) for of in (arms, arms & (np.abs(r) < np.abs(r[arms]).max() / 2)))
    better = (near - whole)[..., arms].sum(axis=-1, keepdims=True) > 0.0
    return np.where(better, near, whole)


def _density(off: Reals, variance: Reals) -> Reals:
    return np.asarray(np.exp(-off * off / (2 * variance)) / np.sqrt(2 * np.pi * variance))
