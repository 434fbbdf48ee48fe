"""Start values of the motion: closed intersections pulse by pulse, lateness of one camera, gaps filled."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from analysis.motion.model.channels import CHANNELS, START_MEAN, VECTORS, MotionFrame, ski_channels
from analysis.motion.model.observations import Observations
from analysis.scene.camera_system import CameraSystem
from photogrammetry.geometry.rotation import cross
from photogrammetry.intersection.point_intersection import intersect_points
from photogrammetry.jumper.stick_model import slope_and_heading
from rig.arrays import Flags, Floats

_LATEST_FRAMES: Final = 2.0  #: a camera's lateness is searched so far either way
_LATENESS_STEP: Final = 0.125  # frames
_CLEAR_GAIN: Final = 4.0  # times smaller residuals: a camera is taken to be late
_MIN_ANGLE: Final = np.sin(np.radians(2.0))  # between the planes of a ski, for a start value
_POINTS = 4
_NEIGHBOURS = 2  # pulses on each side, whose median tells a gross error of a start value
_FAR_M, _FAR_RAD = 0.5, 0.6  # from that median
FEWEST: Final = 4  #: pulses with an intersected point that a motion needs


@dataclass(frozen=True, slots=True, eq=False)
class Start:
    """Start values.

    Attributes:
        frame: of the motion.
        channels: (n, 16).
        late: (m,) s, by which each camera is later than it says.
    """

    frame: MotionFrame
    channels: Floats
    late: Floats


def start_values(observed: Observations, system: CameraSystem) -> Start | None:
    """Start values of a jump; None where fewer than `FEWEST` pulses have a point in two cameras."""
    flat = _flat(observed, system)
    late = _lateness(observed, system, flat)
    points = _intersected(observed, system, _shifted(observed, flat, late))
    place = _mean_place(points)
    known = np.isfinite(place[:, 0])
    if known.sum() < FEWEST:
        return None
    frame = _frame(observed.times, place)
    channels = np.full((len(points), CHANNELS), np.nan)
    channels[:, :VECTORS] = _vectors((points - frame.origin) @ frame.rotation)
    channels[:, VECTORS:] = ski_channels(*(_ski(observed, system, frame, side) for side in range(2)))
    return Start(frame, _filled(observed.times, channels), late)


def _flat(observed: Observations, system: CameraSystem) -> Floats:
    """Points (n, m, 4, 2) reduced; NaN where not seen."""
    flat = np.stack([system[name].reduced(observed.xy[:, i, :_POINTS, 0]) for i, name in enumerate(observed.names)], 1)
    return np.where(observed.seen[:, :, :_POINTS, None], flat, np.nan)


def _shifted(observed: Observations, flat: Floats, late: Floats) -> Floats:
    """The points as they would be, were the cameras not late: between pulses interpolated."""
    out = flat.copy()
    for i in np.flatnonzero(late):
        out[:, i] = _earlier(observed.times, flat[:, i], late[i : i + 1])[0]
    return out


def _earlier(times: Floats, values: Floats, late: Floats) -> Floats:
    """Values (t, n, ...) earlier than times (n,) by each of t latenesses, from the values (n, ...) at these times.

    Linear between neighbouring pulses; NaN where one of them has no value.
    """
    at = times - late[:, None]
    after = np.clip(np.searchsorted(times, at), 1, len(times) - 1)
    more = (1,) * (values.ndim - 1)
    share = ((at - times[after - 1]) / (times[after] - times[after - 1])).reshape(*at.shape, *more)
    inside = ((at >= times[0]) & (at <= times[-1])).reshape(*at.shape, *more)
    return np.where(inside, (1 - share) * values[after - 1] + share * values[after], np.nan)


def _lateness(observed: Observations, system: CameraSystem, flat: Floats) -> Floats:
    """Lateness (m,) of the one camera, if any, that fits clearly better when it is taken to be late, s."""
    m = len(observed.names)
    unit = float(np.median(np.diff(observed.times)))
    tries = np.arange(-_LATEST_FRAMES, _LATEST_FRAMES + _LATENESS_STEP / 2, _LATENESS_STEP) * unit
    synchronous = least = float(_misfits(observed, system, flat[None])[0])
    late = np.zeros(m)
    for camera in range(1 if m == 2 else 0, m):
        tried = np.repeat(flat[None], len(tries), axis=0)
        tried[:, :, camera] = _earlier(observed.times, flat[:, camera], tries)
        misfits = _misfits(observed, system, tried)
        if misfits.min() < least:
            least = float(misfits.min())
            late = np.where(np.arange(m) == camera, tries[misfits.argmin()], 0.0)
    return late if _CLEAR_GAIN * least < synchronous else np.zeros(m)


def _misfits(observed: Observations, system: CameraSystem, tried: Floats) -> Floats:
    """Median residuals (t,) of the intersections of t sets of points; infinite where too few of a set are left."""
    xy = tried.swapaxes(2, 3).reshape(-1, tried.shape[2], 2)
    seen = np.asarray(np.isfinite(xy).all(axis=-1))
    use = seen.sum(axis=1) >= 2
    found = intersect_points([system[name].ideal() for name in observed.names], xy[use], seen=seen[use])
    redundancy = 2 * seen[use].sum(axis=1) - 3
    size = np.sqrt(np.nansum(found.residuals**2, axis=(1, 2)) / redundancy)
    count = use.reshape(len(tried), -1).sum(axis=1)
    sets = np.split(size, np.cumsum(count)[:-1])
    return np.array([np.median(one) if len(one) >= FEWEST else np.inf for one in sets])


def _intersected(observed: Observations, system: CameraSystem, flat: Floats) -> Floats:
    """P1..P4 (n, 4, 3) of each pulse alone, NaN where not determined; of three rays the worst may be left out."""
    n, m = observed.shape
    cameras = [system[name].ideal() for name in observed.names]
    xy = flat.transpose(0, 2, 1, 3).reshape(-1, m, 2)
    seen = np.asarray(np.isfinite(xy).all(axis=-1))
    found = intersect_points(cameras, xy, seen=seen)
    points = np.where(found.ok[:, None], found.X, np.nan)
    size = np.linalg.norm(np.nan_to_num(found.residuals), axis=-1).max(axis=1)
    usual = np.median(size[found.ok]) if found.ok.any() else 0.0
    suspect = (seen.sum(axis=1) >= 3) & ~(size < 6 * usual)
    best = np.where(suspect, size, 0.0)
    for left_out in range(m):
        rest: Flags = seen & (np.arange(m) != left_out) & suspect[:, None]
        again = intersect_points(cameras, xy, seen=rest)
        worst = np.linalg.norm(np.nan_to_num(again.residuals), axis=-1).max(axis=1)
        better = suspect & again.ok & ~(worst >= best)
        points[better], best[better] = again.X[better], worst[better]
    return points.reshape(n, _POINTS, 3)


def _mean_place(points: Floats) -> Floats:
    """Mean (n, 3) of the points of each pulse; NaN where there is none."""
    known = np.isfinite(points[..., :1])
    with np.errstate(invalid="ignore"):
        return np.asarray(np.where(known, points, 0.0).sum(axis=1) / known.sum(axis=1))


def _frame(times: Floats, place: Floats) -> MotionFrame:
    known = np.isfinite(place[:, 0])
    slopes = [np.median(np.diff(place[known, axis]) / np.diff(times[known])) for axis in range(2)]
    heading = np.arctan2(slopes[1], slopes[0])
    cosine, sine = np.cos(heading), np.sin(heading)
    rotation = np.array(((cosine, -sine, 0.0), (sine, cosine, 0.0), (0.0, 0.0, 1.0)))
    return MotionFrame(np.median(place[known], axis=0), rotation)


def _vectors(points: Floats) -> Floats:
    """The first twelve channels (n, 12) from points (n, 4, 3) in the frame of the motion; what is missing stays NaN."""
    helmet, hip, right, left = points.transpose(1, 0, 2)
    between = left - right
    usual = np.nanmedian(between, axis=0) if np.isfinite(between).any() else START_MEAN[9:12]
    up = np.nanmedian(hip - (left + right) / 2, axis=0) if np.isfinite(hip - left - right).any() else START_MEAN[3:6]
    origin = (right + left) / 2
    for stand_in in (right + usual / 2, left - usual / 2, hip - up, helmet - up - START_MEAN[6:9]):
        origin = np.where(np.isfinite(origin), origin, stand_in)
    return np.concatenate((origin, hip - origin, helmet - hip, between), axis=1)


def _ski(observed: Observations, system: CameraSystem, frame: MotionFrame, side: int) -> Floats:
    """Slope and heading (n, 2) of a ski by intersection of its planes; NaN where they are not determined."""
    group = _POINTS + side
    normals = np.zeros((*observed.shape, 3))
    for i, name in enumerate(observed.names):
        placed = system[name]
        flat = placed.reduced(observed.xy[:, i, group])
        rays = placed.ideal().rays(flat)
        normal = cross(rays[:, 0], rays[:, 1])
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        use = observed.seen[:, i, group, None] & (length > 0)
        normals[:, i] = np.where(use, normal / np.where(length > 0, length, 1.0), 0.0)
    values, vectors = np.linalg.eigh(np.einsum("nmi,nmj->nij", normals, normals))
    direction = vectors[:, :, 0] @ frame.rotation
    direction = direction * np.where(direction[:, :1] < 0, -1.0, 1.0)
    both = slope_and_heading(direction)
    return np.where((values[:, 1] > _MIN_ANGLE**2)[:, None], both, np.nan)


def _filled(times: Floats, channels: Floats) -> Floats:
    """The channels without gross errors and gaps; what was never found is where a body usually has it."""
    out = np.empty_like(channels)
    for c, raw in enumerate(channels.T):
        values = _without_gross_errors(raw, _FAR_M if c < VECTORS else _FAR_RAD) if c >= 3 else raw
        known = np.isfinite(values)
        if not known.any():
            out[:, c] = START_MEAN[c]
        elif c < 3:
            degree = min(2, int(known.sum()) - 1)
            curve = np.polynomial.Polynomial.fit(times[known], values[known], degree)
            out[:, c] = np.where(known, values, curve(times))
        else:
            out[:, c] = np.interp(times, times[known], values[known])
    return out


def _without_gross_errors(values: Floats, far: float) -> Floats:
    windows = np.sort(
        np.lib.stride_tricks.sliding_window_view(
            np.pad(values, _NEIGHBOURS, constant_values=np.nan), 2 * _NEIGHBOURS + 1
        )
    )  # NaN last
    count = np.isfinite(windows).sum(axis=1)
    middle = np.stack(((count - 1) // 2, count // 2), axis=-1)
    usual = np.where(count > 0, np.take_along_axis(windows, np.maximum(middle, 0), axis=1).mean(axis=1), np.nan)
    return np.where(np.abs(values - usual) <= far, values, np.nan)
