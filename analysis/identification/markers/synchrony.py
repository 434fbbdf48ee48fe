"""Which camera shows the jumper later or earlier than the others: so that its spots are named too, and can prove it.

A camera that is late by some milliseconds sees the jumper where no ray of the others meets its rays. It is found by the
time at which its spots lie on the path that the others saw. This is a start for identification only; the offset itself
is measured by the bundle over time.
"""

import numpy as np
from scipy.special import bdtrc, pdtrc

from analysis.identification.markers.markers import Markers
from analysis.identification.over_time.assignment import well_known
from analysis.identification.over_time.flights import Flight
from analysis.identification.over_time.window import Window
from analysis.identification.space.views import Views
from rig.arrays import Flags, Floats, Integers

_LEAST_CAMERAS = 3  #: two cameras cannot tell which of them is late
_AGREES = 0.5  #: share of the expected markers that a camera shows, or of the threefold ones, if all are on time
_BY_CHANCE_P = 1e-6  #: that other spots make as many markers at a time that is not the right one
_APART_M = 0.3  #: of two times: so far behind the right place none of a marker's own spots counts
_NEAR_M = 0.06  #: so near to the path is a marker on it: the others may differ a little among themselves
_AGREE_M = 0.03  #: so far may the jumper have moved for three rays still to meet
_SAMPLE = 8  #: pulses that are tried with other times
_LEAST_AGREEING = 6  #: points more than on time
_MOST_PULSES, _MOST_S = 1.5, 0.02  #: greatest offset, the greater of the two


def lateness(views: Views, window: Window, markers: Markers, flight: Flight) -> Floats:
    """How much later than the others each camera shows the jumper, (m,) s; 0 where it agrees with them."""
    if len(views) < _LEAST_CAMERAS or len(window) < 2:
        return np.zeros(len(views))
    late = _off_path(views, window, markers, flight)
    return late if late.any() else _off_a_little(views, window, markers, flight)


def _off_path(views: Views, window: Window, markers: Markers, flight: Flight) -> Floats:
    """Cameras that show the jumper at another time on the path that the others saw."""
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
        # A marker that the others show less often than not is no more often to be seen in this camera.
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
    """The camera that is so little late that every two cameras agree, but no three: when would three agree?"""
    late = np.zeros(len(views))
    rays = (markers.assigned.rays >= 0).sum(axis=2)
    seen = np.sum([views.inside(k, flight.place(window.time_s)) for k in range(len(views))], axis=0)
    able = (seen >= _LEAST_CAMERAS) & (rays >= 2).any(axis=1)
    if not able.any() or not _too_rarely_three(rays[able], int(np.median(seen[able]))):
        return late
    chosen = np.flatnonzero(able)
    chosen = chosen[np.linspace(0, len(chosen) - 1, min(_SAMPLE, len(chosen))).astype(int)]
    step = _AGREE_M / float(np.linalg.norm(flight.motion[1]))
    offsets = np.arange(-_MOST_S, _MOST_S + step, step)
    part = window.part(chosen)
    counts = np.array([[_agreeing(part(_only(views, k, float(o)))) for o in offsets] for k in range(len(views))])
    k, best = np.unravel_index(counts.argmax(), counts.shape)
    if counts[k, best] >= 2 * _agreeing(part(late)) + _LEAST_AGREEING:
        late[k] = float(offsets[counts[k] > 0.9 * counts[k, best]].mean())
    return late


def _only(views: Views, k: int, offset: float) -> Floats:
    late = np.zeros(len(views))
    late[k] = offset
    return late


def _agreeing(window: Window) -> int:
    """How many points three cameras or more show."""
    return sum(int((points.count > 2).sum()) for points in window.points)


def _too_rarely_three(rays: Integers, cameras: int) -> bool:
    """Whether points with three rays are much rarer than chance would have it if markers were missed one by one."""
    two, three = int((rays >= 2).sum()), int((rays > 2).sum())
    shown = rays[rays >= 2].mean() / cameras
    return bool(three / two < _AGREES * bdtrc(2, cameras, shown) / bdtrc(1, cameras, shown))
