"""Which camera shows the jumper later or earlier than the others, so that its spots can be named too.

A camera that is late by some milliseconds sees the jumper where no ray of the others meets its rays. It is found by the
time at which its spots lie on the path that the others saw. This is a start for identification only; the offset itself
is measured by the bundle over time.
"""

from typing import Final

import numpy as np
from scipy.special import pdtrc

from analysis.identification.markers.markers import Markers
from analysis.identification.over_time.assignment import well_known
from analysis.identification.over_time.flights import Flight
from analysis.identification.over_time.window import Window
from analysis.identification.space.views import Views
from rig.arrays import Flags, Floats, Integers

_LEAST_CAMERAS = 3  #: two cameras cannot tell which of them is late
_AGREES = 0.5  #: least share of the expected markers that a camera shows while all cameras are on time
_BY_CHANCE_P = 1e-6  #: of so many markers at a wrong time by chance
_APART_M = 0.3  #: the jumper's way between two times, beyond which the marker's own spots no longer count
_NEAR_M = 0.06  #: a marker so near to the path is on it: the other cameras may differ a little too
_AGREE_M = 0.03  #: the jumper's way during an offset at which three rays still meet
_COARSE = 3  #: steps of the time that are taken at once at first
_FEW_PULSES, _MANY_PULSES = 8, 32  #: that are tried with other times, at first and in the end
_PLACES: Final = 4  #: cameras and times that are tried in more pulses
_NEARLY: Final = 0.9  #: of the most spots: at such times, too, the camera may show him
_TIMES, _SIGMAS = 1.5, 4.0  #: as many spots as on time, and so much more than chance
_MOST_PULSES, _MOST_S = 1.5, 0.02  #: greatest offset, the greater of the two


def lateness(views: Views, window: Window, markers: Markers, flight: Flight) -> Floats:
    """How much later than the others each camera shows the jumper, (m,) s; 0 where it agrees with them."""
    if len(views) < _LEAST_CAMERAS or len(window) < 2:
        return np.zeros(len(views))
    late = _off_path(views, window, markers, flight)
    return late if late.any() else _off_a_little(views, window, markers, flight)


def _off_path(views: Views, window: Window, markers: Markers, flight: Flight) -> Floats:
    """Offsets of cameras whose spots lie elsewhere in time on the path that the other cameras saw."""
    late = np.zeros(len(views))
    known = well_known(markers.predicted.covariance)
    greatest = max(_MOST_S, _MOST_PULSES * float(np.median(np.diff(window.time_s))))
    speed = float(np.linalg.norm(flight.motion[1]))
    step = _NEAR_M / 2 / speed
    offsets = np.append(np.arange(-greatest, greatest + step, step), 0.0)
    inside = np.stack([views.inside(k, markers.predicted.xyz.reshape(-1, 3)) for k in range(len(views))], axis=1)
    expected = known[..., None] & window.delivered[:, None] & inside.reshape(*known.shape, len(views))
    count = expected.sum(axis=(0, 1))
    shown = (expected & (markers.assigned.rays >= 0)).sum(axis=(0, 1)) / np.maximum(count, 1)
    for k in np.flatnonzero((count > 0) & (shown <= _AGREES)).tolist():
        counts = np.array([_met(views, window, markers, k, expected[..., k], float(offset)) for offset in offsets])
        best = int(counts.argmax())
        wrong = np.abs(offsets - offsets[best]) > _APART_M / speed
        if not wrong.any():  # he is too slow for times to differ
            continue
        chance = float(counts[wrong].mean())
        # This camera will not show markers more often than the others do.
        usual = float(np.median(np.delete(shown, k)))
        enough = max(_AGREES * usual * float(count[k]), 2.0 * counts[-1])
        if counts[best] > enough and pdtrc(counts[best] - 1, chance) < _BY_CHANCE_P:
            late[k] = float(offsets[counts == counts[best]].mean())
    return late


def _met(views: Views, window: Window, markers: Markers, k: int, expected: Flags, offset: float) -> int:
    """How many expected markers (t, n) have a spot in camera k where they are by `offset` later."""
    path, time_s = markers.predicted.xyz, window.time_s
    moved = np.stack(
        [[np.interp(time_s + offset, time_s, path[:, i, j]) for j in range(3)] for i in range(path.shape[1])]
    ).transpose(2, 0, 1)
    xy = views.placed[k].project(moved.reshape(-1, 3)).reshape(*expected.shape, 2)
    near = _NEAR_M * views.scale[k]
    met = 0
    for t in np.flatnonzero(expected.any(axis=1)).tolist():
        spots = window.rays[t][k].xy
        if len(spots):
            distance = np.linalg.norm(xy[t, expected[t], None] - spots, axis=2).min(axis=1)
            met += int((distance < near).sum())
    return met


def _off_a_little(views: Views, window: Window, markers: Markers, flight: Flight) -> Floats:
    """The camera that is so little late that every two cameras agree, but hardly three: when would three agree?

    At wrong times other spots meet by chance, and names that these lead to hide that a camera is late. So the spots
    that three cameras agree in are counted at all times, first in a few pulses and with large steps.
    """
    late = np.zeros(len(views))
    rays = (markers.assigned.rays >= 0).sum(axis=2)
    seen = np.sum([views.inside(k, flight.place(window.time_s)) for k in range(len(views))], axis=0)
    able = np.flatnonzero((seen >= _LEAST_CAMERAS) & (rays >= 2).any(axis=1))
    step = _AGREE_M / float(np.linalg.norm(flight.motion[1]))
    if not len(able) or step >= _MOST_S:  # he is too slow for times to differ
        return late
    coarse = np.arange(-_MOST_S, _MOST_S + step, _COARSE * step)
    some, more = (window.part(_spread(able, count)) for count in (_FEW_PULSES, _MANY_PULSES))
    counts = np.array([[_agreeing(some(_only(views, k, float(o)))) for o in coarse] for k in range(len(views))])
    most = on_time = _agreeing(more(late))
    for place in np.argsort(-counts, axis=None)[:_PLACES]:
        k, i = divmod(int(place), len(coarse))
        offsets = coarse[i] + np.arange(-_COARSE, _COARSE + 1) * step
        fine = np.array([_agreeing(more(_only(views, k, float(o)))) for o in offsets])
        found = int(fine.max())
        clear = found > _TIMES * on_time and found - on_time > _SIGMAS * np.sqrt(found + on_time)
        if clear and found > most:
            most, late = found, _only(views, k, float(offsets[fine > _NEARLY * found].mean()))
    return late


def _spread(steps: Integers, count: int) -> Integers:
    """So many of some steps, spread over them."""
    return np.asarray(steps[np.linspace(0, len(steps) - 1, min(count, len(steps))).astype(int)])


def _only(views: Views, k: int, offset: float) -> Floats:
    late = np.zeros(len(views))
    late[k] = offset
    return late


def _agreeing(window: Window) -> int:
    """How many spots have rays that meet those of two other cameras: where points share spots, these count once."""
    return sum(_spots(points.rays[points.count >= _LEAST_CAMERAS]) for points in window.points)


def _spots(rays: Integers) -> int:
    """Number of different spots of all cameras."""
    return sum(len(np.unique(of[of >= 0])) for of in rays.T)
