"""Seeks both skis in space where no binding is known: from about where the feet are, by the images of all cameras.

The evidence of a line in an image is that of `directions`. A ski in space, with the place X of its binding and its
direction d, makes a line in each image; the sum of what these tell, and of the logarithms of the densities of X and d,
is computed for places on a grid around the feet with directions on another one. The second ski is sought beside the
first one, which explains what it covers. Pairs of pulses that follow one another differ little: of the best ones of
each pulse those are taken whose sum over all pulses is the largest (Viterbi).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from analysis.ski_bars.bars import SKIS, USUAL_SHAPE
from analysis.ski_bars.directions import (
    FARTHEST_RAD,
    HEADING_RAD_S,
    HEADING_SIGMA,
    OPENING,
    OPENING_SIGMA,
    SLOPE_RAD_S,
    SLOPE_SIGMA,
    SLOPES_APART,
    LineTable,
    directions,
    line_table,
)
from analysis.ski_bars.pixels import SkiView
from photogrammetry.jumper.stick_model import slope_and_heading
from rig.arrays import Floats

_TURN: Final = np.radians(5.0)  #: between directions that are tried
_STEPS_M: Final = np.array((0.15, 0.08, 0.08))  #: between places that are tried, forward, to the left and up
_SIGMAS: Final = 2.5  #: so far from what is expected
_REFINED: Final = 2  #: times as many skis as are wanted are sought on a finer grid
_BETWEEN: Final = np.array((-0.5, 0.0, 0.5))  #: steps of that one
_FIRST: Final = 3  #: first skis of a pulse, each of which gets a second one on either side
#: Two skis count as different ones if they are so far apart, m, or differ so much in direction.
_OTHER_M, _OTHER_RAD = 0.16, np.radians(10.0)
_FEET_M_S: Final = 1.0  #: how fast feet move against the body
_ELSEWHERE: Final = -50.0  #: gain (logarithm) of a line farther from the feet than all lines that were looked at


@dataclass(frozen=True, slots=True, eq=False)
class Feet:
    """About where the bindings of t pulses are.

    Attributes:
        xyz: (t, 3) half way between both, m.
        covariance: (t, 3, 3) m^2.
        apart: (3,) from the right one to the left one, m.
        apart_sigma: (3,) standard deviations of that, forward, to the left and up.
    """

    xyz: Floats
    covariance: Floats
    apart: Floats
    apart_sigma: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Pairs:
    """Both skis at t pulses.

    Attributes:
        point: (t, 2, 3) on the axes, about where the bindings are, m.
        direction: (t, 2, 3) unit vectors from tail to tip.
        gain: (t, 2) how much likelier than no ski, natural logarithm.
    """

    point: Floats
    direction: Floats
    gain: Floats


@dataclass(frozen=True, slots=True, eq=False)
class _Ski:
    point: Floats
    direction: Floats
    gain: float


@dataclass(frozen=True, slots=True, eq=False)
class _Grid:
    """Directions (n, 3), their slopes and headings (n, 2), the logarithm (n,) of the density of each, and the frame."""

    direction: Floats
    angles: Floats
    density: Floats
    axes: Floats


def seek_pairs(pulses: Sequence[Sequence[SkiView]], feet: Feet, time_s: Floats, axes: Floats) -> Pairs:
    """Seek both skis at t pulses.

    Args:
        pulses: what the cameras show.
        feet: about where they are.
        time_s: (t,) of the pulses.
        axes: (3, 3) forward, left and up as rows.
    """
    slope, heading = (np.arange(-round(most / _TURN), round(most / _TURN) + 1) * _TURN for most in FARTHEST_RAD)
    density = -0.5 * ((slope[:, None] / SLOPE_SIGMA) ** 2 + (heading / HEADING_SIGMA) ** 2)
    direction = directions(slope, heading, axes).reshape(-1, 3)
    angles = np.array([slope_and_heading(of) for of in direction @ axes.T])
    grid = _Grid(direction, angles, density.ravel(), axes)
    found = [list(_pairs(views, feet, t, grid)) for t, views in enumerate(pulses)]
    chosen = _path(found, feet.xyz, time_s, axes)
    return Pairs(
        np.array([[ski.point for ski in pair] for pair in chosen]),
        np.array([[ski.direction for ski in pair] for pair in chosen]),
        np.array([[ski.gain for ski in pair] for pair in chosen]),
    )


def _pairs(views: Sequence[SkiView], feet: Feet, t: int, grid: _Grid) -> Iterator[tuple[_Ski, _Ski]]:
    """The likeliest pairs of a pulse, right ski and left one."""
    spread = grid.axes.T @ np.diag(feet.apart_sigma**2) @ grid.axes
    anywhere = feet.covariance[t] + (spread + np.outer(feet.apart, feet.apart)) / 4
    for first in _skis(views, feet.xyz[t], anywhere, grid, None, _FIRST):
        alone = _far(first.point - feet.xyz[t], anywhere)
        off = grid.angles - slope_and_heading(grid.axes @ first.direction)
        for side in (1, -1):
            opening = (side * off[:, 1] - OPENING) / OPENING_SIGMA
            apart = (off[:, 0] / SLOPES_APART) ** 2 + opening**2
            beside = replace(grid, density=grid.density - 0.5 * apart)
            (second,) = _skis(views, first.point + side * feet.apart, spread, beside, first, 1)
            # what is known is where the middle of both is
            middle = _far((first.point + second.point) / 2 - feet.xyz[t], feet.covariance[t])
            one = replace(first, gain=first.gain + 0.5 * (alone - middle))
            yield (one, second) if side > 0 else (second, one)


def _far(off: Floats, covariance: Floats) -> float:
    return float(off @ np.linalg.solve(covariance, off))


def _skis(
    views: Sequence[SkiView], place: Floats, covariance: Floats, grid: _Grid, other: _Ski | None, count: int
) -> list[_Ski]:
    """The `count` likeliest skis about a place, apart from one another."""
    reach = _SIGMAS * float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))
    taken = None if other is None else (other.point, other.direction)
    at, far = _around(covariance, grid.axes)
    seen = [
        (view, table, place + view.shift)
        for view in views
        if (table := line_table(view, place + view.shift, _TURN, reach, taken)) is not None
    ]
    total = grid.density[:, None] - 0.5 * far + sum(_told(*of, grid.direction, at) for of in seen)
    found: list[_Ski] = []
    for best in np.argsort(-total.max(axis=1)):
        i = int(total[best].argmax())
        ski = _Ski(at[i], grid.direction[best], float(total[best, i]))
        if all(_are_others(ski, known) for known in found):
            found.append(ski)
        if len(found) == _REFINED * count:
            break
    refined = [_nearby(ski, seen, covariance, grid) for ski in found]
    best_of = sorted(refined, key=lambda ski: -ski.gain)[:count]
    return [_Ski(place + ski.point, ski.direction, ski.gain) for ski in best_of]


def _nearby(ski: _Ski, seen: Sequence[tuple[SkiView, LineTable, Floats]], covariance: Floats, grid: _Grid) -> _Ski:
    """The likeliest one on a finer grid around a ski; places are steps from the one that is expected."""
    gain, point, direction = ski.gain, ski.point, ski.direction
    i = int((grid.direction @ direction).argmax())
    aside = np.cross(direction, grid.axes[2])
    aside /= np.linalg.norm(aside)
    turns = np.stack(np.meshgrid(_BETWEEN, _BETWEEN), axis=-1).reshape(-1, 2) * _TURN
    turned = direction + turns @ np.stack((aside, np.cross(aside, direction)))
    turned /= np.linalg.norm(turned, axis=1, keepdims=True)
    steps = np.stack(np.meshgrid(*[_BETWEEN * step for step in _STEPS_M]), axis=-1).reshape(-1, 3)
    at = point + steps @ grid.axes
    far = (at * np.linalg.solve(covariance, at.T).T).sum(axis=1)
    total = np.tile(grid.density[i] - 0.5 * far, (len(turned), 1)) + sum(_told(*of, turned, at) for of in seen)
    j, k = np.unravel_index(int(total.argmax()), total.shape)
    return _Ski(at[k], turned[j], float(total[j, k])) if total[j, k] > gain else ski


def _around(covariance: Floats, axes: Floats) -> tuple[Floats, Floats]:
    """Steps (o, 3) to places around one that is expected, and squared deviations (o,) of these."""
    sigma = np.sqrt(np.einsum("ij,jk,ik->i", axes, covariance, axes))
    count = np.ceil(_SIGMAS * sigma / _STEPS_M)
    each = [np.arange(-n, n + 1) * step for n, step in zip(count, _STEPS_M, strict=True)]
    at = np.stack(np.meshgrid(*each, indexing="ij"), axis=-1).reshape(-1, 3) @ axes
    far = (at * np.linalg.solve(covariance, at.T).T).sum(axis=1)
    near = far <= _SIGMAS**2
    return at[near], far[near]


def _are_others(one: _Ski, other: _Ski) -> bool:
    """Whether two skis lie apart."""
    off = one.point - other.point
    off = off - (off @ other.direction) * other.direction
    return bool(np.linalg.norm(off) > _OTHER_M or one.direction @ other.direction < np.cos(_OTHER_RAD))


def _told(view: SkiView, table: LineTable, place: Floats, direction: Floats, at: Floats) -> Floats:
    """Evidence of an image for skis with n directions at o places, logarithms (n, o)."""
    by_place = view.camera.linearised(place[None], table.xy[None])[1].reshape(2, 3)
    ends = view.camera.project(place + np.array(USUAL_SHAPE[1:])[:, None, None] * direction)
    if not np.isfinite(ends).all():
        return np.zeros((len(direction), len(at)))
    chord = ends[1] - ends[0]
    turn, unit = table.nearest(np.arctan2(chord[:, 1], chord[:, 0]))
    moved = at @ by_place.T
    r, u = unit @ moved.T, unit[:, :1] * moved[:, 1] - unit[:, 1:] * moved[:, 0]
    first, last = np.sort(((ends - table.xy) * unit).sum(axis=-1), axis=0)
    sums, inside = table.between(turn[:, None], u, first[:, None] + r, last[:, None] + r)
    return np.where(inside, sums, _ELSEWHERE)


def _path(
    found: Sequence[Sequence[tuple[_Ski, _Ski]]], feet: Floats, time_s: Floats, axes: Floats
) -> list[tuple[_Ski, _Ski]]:
    """Of the pairs of each pulse the ones whose sum is the largest."""
    best = np.array([sum(ski.gain for ski in pair) for pair in found[0]])
    before = []
    for t in range(1, len(found)):
        dt = float(time_s[t] - time_s[t - 1])
        step = np.array([[_change(a, b, feet[t] - feet[t - 1], dt, axes) for a in found[t - 1]] for b in found[t]])
        total = best - 0.5 * step
        before.append(total.argmax(axis=1))
        best = total.max(axis=1) + [sum(ski.gain for ski in pair) for pair in found[t]]
    path = [int(best.argmax())]
    for of in reversed(before):
        path.append(int(of[path[-1]]))
    return [pairs[i] for pairs, i in zip(found, path[::-1], strict=True)]


def _change(one: tuple[_Ski, _Ski], other: tuple[_Ski, _Ski], moved: Floats, dt: float, axes: Floats) -> float:
    """Squared deviations of a pair from the one before, which moves with the feet."""
    square = 0.0
    for k in range(SKIS):
        off = np.linalg.norm(other[k].point - one[k].point - moved)
        turned = slope_and_heading(axes @ other[k].direction) - slope_and_heading(axes @ one[k].direction)
        sigma = np.hypot(np.array((SLOPE_RAD_S, HEADING_RAD_S)) * dt, _TURN)
        square += float(off**2 / ((_FEET_M_S * dt) ** 2 + _STEPS_M[0] ** 2) + ((turned / sigma) ** 2).sum())
    return square
