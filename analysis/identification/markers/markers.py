"""The markers of one jump: from points in space that have names to a spot for each marker in every image that shows it.

Prediction and assignment take turns: what is assigned at other pulses predicts where a marker is at this one.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from analysis.candidates.model import SecondLook, Spots
from analysis.identification.markers.left_right import name_bindings
from analysis.identification.markers.naming import name_points
from analysis.identification.over_time.assignment import Assigned, assign, well_known
from analysis.identification.over_time.flights import Flight
from analysis.identification.over_time.prediction import Part, PathFilter, Prediction, predict
from analysis.identification.over_time.window import Window
from analysis.identification.ski_bars import Bindings
from analysis.identification.space.body import BINDINGS, USUAL, implausibility
from analysis.identification.space.sides import shown
from analysis.identification.space.views import Views
from analysis.measurements.model import POINTS
from rig.arrays import Flags, Floats, Integers

#: P1, P2, P3 and P4 as sums of P1, P2, the midpoint of the bindings and half the way from P3 to P4.
_MIXING = np.array([(1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, -1.0), (0.0, 0.0, 1.0, 1.0)])
ANYWHERE_M = 100.0
_VELOCITY_M_S, _ACCELERATION_M_S2 = 6.0, 15.0  #: of a part of the body against the flight, standard deviations
_LIMBS_M_S2 = 25.0  #: change of the acceleration of helmet and hip within 0.1 s
_FEET_M_S2 = 15.0  #: of the bindings: they follow the table and then the flight
_HALF_GAP_M = 0.22  #: from the midpoint to a binding: 0.16 m in the tracks of the table, up to 0.3 m in flight
_GAP_SIGMA = (0.07, 1.0, 5.0)  #: of it, m, m/s, m/s^2
_HIP = 1  #: index of P2 in `POINTS`
_ASIDE_M = 0.18  #: from the body's middle to a binding, standard deviation beside half the gap
_HIP_M = 0.05  #: of a point that was taken as the hip, standard deviation beside its own
#: From the midpoint of the bindings to the hip, standard deviations: m, m/s, m/s^2 and its change within 0.1 s. Along
#: and up it moves as legs stretch; aside the body hardly leans.
_HIP_FREE, _HIP_ASIDE = (1.0, 4.0, 25.0, 25.0), (0.08, 0.4, 2.0, 3.0)
_GAP_M_S2 = 4.0  #: change of its acceleration within 0.1 s
_LEAST_PAIRS = 3
_MOST_TURNS = 12
_MOST_RENAMINGS = 3
_AS_THEY_ARE = np.array((0, 1))


@dataclass(frozen=True, slots=True, eq=False)
class Markers:
    """The markers of a jump at t pulses.

    Attributes:
        assigned: their spots.
        predicted: their places by the other pulses.
    """

    assigned: Assigned
    predicted: Prediction

    def places(self, markers: Sequence[int]) -> Bindings:
        """Places of some markers by all pulses, this one too."""
        which = list(markers)
        inverse = np.linalg.inv(self.predicted.covariance[:, which])
        right = inverse @ self.predicted.xyz[:, which, :, None]
        seen = np.asarray(np.isfinite(self.assigned.xyz[:, which]).all(axis=2))
        measured = np.linalg.inv(np.where(seen[..., None, None], self.assigned.covariance[:, which], np.eye(3)))
        measured[~seen] = 0.0
        right += measured @ np.nan_to_num(self.assigned.xyz[:, which])[..., None]
        covariance = np.asarray(np.linalg.inv(inverse + measured), float)
        return Bindings((covariance @ right)[..., 0], covariance)


def follow_markers(views: Views, window: Window, flight: Flight) -> Markers:
    """Find the spots of all markers in the candidates of a window."""
    named = _trusted(views, name_points(views, window, flight), window, flight)
    xyz = np.full((len(window), len(POINTS), 3), np.nan)
    covariance = np.full((len(window), len(POINTS), 3, 3), np.nan)
    for t, i in np.argwhere(named >= 0).tolist():
        xyz[t, i], covariance[t, i] = window.points[t].xyz[named[t, i]], window.points[t].covariance[named[t, i]]
    return _settled(views, window, flight, xyz, covariance)


def follow_further(views: Views, window: Window, flight: Flight, markers: Markers, look: SecondLook) -> Markers:
    """Look again where a marker is expected and no spot was found; what is found is added to the window."""
    if not window.add(_looked(views, window, markers, look)):
        return markers
    return settled_again(views, window, flight, markers)


def settled_again(views: Views, window: Window, flight: Flight, markers: Markers) -> Markers:
    """The markers of a window whose spots have changed; the markers before are the start."""
    return _settled(views, window, flight, markers.assigned.xyz, markers.assigned.covariance)


def with_bindings(
    window: Window, flight: Flight, markers: Markers, steps: Integers, xyz: Floats, covariance: Floats
) -> Markers:
    """The markers with bindings at given places, which have no spots.

    Args:
        window: t pulses.
        flight: of the jumper.
        markers: whose helmet and hip are kept.
        steps: (s,) pulses at which the bindings have places.
        xyz: (s, 2, 3) of these.
        covariance: (s, 2, 3, 3) of them.
    """
    rays = markers.assigned.rays.copy()
    places, spread = markers.assigned.xyz.copy(), markers.assigned.covariance.copy()
    rays[:, BINDINGS], places[:, BINDINGS] = -1, np.nan
    for i, marker in enumerate(BINDINGS):
        places[steps, marker], spread[steps, marker] = xyz[:, i], covariance[:, i]
    predicted = predict(window.time_s, places, spread, _parts(flight), _MIXING)
    return Markers(Assigned(rays, places, spread), predicted)


def _settled(views: Views, window: Window, flight: Flight, xyz: Floats, covariance: Floats) -> Markers:
    """The markers after so many turns that nothing changes; xyz (t, 4, 3) with covariance to begin with.

    Then the bindings are named once more as one path. Where that names them otherwise, prediction and assignment go on
    from there, and what is still named otherwise in the end is left out.
    """
    markers = _assigned(views, window, flight, xyz, covariance)
    for _ in range(_MOST_RENAMINGS):
        names = _names(window, flight, markers.assigned)
        if not np.any((names >= 0) & (names != _AS_THEY_ARE)):
            break
        markers = _assigned(views, window, flight, *_renamed(markers.assigned, names))
    else:
        names = _names(window, flight, markers.assigned)
    return without_bindings(markers, names != _AS_THEY_ARE)


def _names(window: Window, flight: Flight, assigned: Assigned) -> Integers:
    """Names (t, 2) of the bindings as one path; as they are where there are hardly any pairs that tell the sides."""
    there: Flags = np.asarray(np.isfinite(assigned.xyz[:, BINDINGS]).all(axis=2))
    if np.count_nonzero(np.all(there, axis=1)) < _LEAST_PAIRS:
        return np.broadcast_to(_AS_THEY_ARE, there.shape)
    things = [*BINDINGS, _HIP]
    xyz = assigned.xyz[:, things] @ flight.axes.T
    covariance = flight.axes @ assigned.covariance[:, things] @ flight.axes.T
    covariance[:, -1] += _HIP_M**2 * np.eye(3)
    apart = np.nan_to_num(xyz[:, 1] - xyz[:, 0])
    strange = np.stack([implausibility(BINDINGS[0], BINDINGS[1], difference) for difference in (apart, -apart)], axis=1)
    return name_bindings(window.time_s, xyz, covariance, np.maximum(strange - USUAL, 0.0), _legs(flight))


def _legs(flight: Flight) -> PathFilter:
    """How bindings and hip move, in the frame of the flight: midpoint, half way between, and from there to the hip."""
    path = np.stack((flight.place(flight.middle_s + np.zeros(1))[0], flight.motion[1])) @ flight.axes.T
    anywhere = (ANYWHERE_M, _VELOCITY_M_S, _ACCELERATION_M_S2)
    gap = np.array(((0.0, _HALF_GAP_M, 0.0), (0.0, 0.0, 0.0)))
    sigma = tuple(np.array((free, aside, free)) for free, aside in zip(_HIP_FREE, _HIP_ASIDE, strict=True))
    return PathFilter(
        3,
        [
            Part(path, anywhere, _FEET_M_S2),
            Part(gap, _GAP_SIGMA, _GAP_M_S2),
            Part(np.zeros((2, 3)), (sigma[0], sigma[1], sigma[2]), sigma[3]),
        ],
        np.array([(1.0, -1.0, 0.0), (1.0, 1.0, 0.0), (1.0, 0.0, 1.0)]),
    )


def _renamed(assigned: Assigned, names: Integers) -> tuple[Floats, Floats]:
    """Points (t, 4, 3) and covariances after the bindings got other names (t, 2)."""
    xyz, covariance = assigned.xyz.copy(), assigned.covariance.copy()
    for place, marker in enumerate(BINDINGS):
        known = names[:, place] >= 0
        source = np.array(BINDINGS)[names[:, place]]
        rows = np.arange(len(names))
        xyz[:, marker] = np.where(known[:, None], assigned.xyz[rows, source], np.nan)
        covariance[:, marker] = np.where(known[:, None, None], assigned.covariance[rows, source], np.nan)
    return xyz, covariance


def without_bindings(markers: Markers, left_out: Flags) -> Markers:
    """The markers without the bindings left_out (t, 2), and without single rays that were named by these."""
    out = np.zeros(markers.assigned.rays.shape[:2], bool)
    for place, marker in enumerate(BINDINGS):
        points: Flags = np.isfinite(markers.assigned.xyz[:, marker, 0])
        if not np.any(left_out[:, place] & points):
            continue
        out[:, marker] = left_out[nearest_known(points), place] & np.any(markers.assigned.rays[:, marker] >= 0, axis=1)
    rays, xyz = markers.assigned.rays.copy(), markers.assigned.xyz.copy()
    rays[out], xyz[out] = -1, np.nan
    return replace(markers, assigned=replace(markers.assigned, rays=rays, xyz=xyz))


def nearest_known(known: Flags) -> Integers:
    """For each of t pulses the nearest one that is known (t,); at least one is."""
    at = np.flatnonzero(known)
    return np.asarray(at[np.abs(np.arange(len(known))[:, None] - at).argmin(axis=1)])


def _assigned(views: Views, window: Window, flight: Flight, xyz: Floats, covariance: Floats) -> Markers:
    """Predict and assign in turns until nothing changes."""
    parts = _parts(flight)
    rays = np.full((len(window), len(POINTS), len(views)), -2)
    before: tuple[Prediction, Assigned] | None = None
    for _ in range(_MOST_TURNS):
        predicted = predict(window.time_s, xyz, covariance, parts, _MIXING)
        assigned = assign(views, window, predicted, flight.axes, before)
        if (assigned.rays == rays).all():
            break
        before = predicted, assigned
        rays, xyz, covariance = assigned.rays, assigned.xyz, assigned.covariance
    return Markers(assigned, predicted)


def _looked(views: Views, window: Window, markers: Markers, look: SecondLook) -> dict[tuple[int, int], list[Spots]]:
    """What second looks find where a marker is expected and has no spot, by pulse and camera."""
    found: dict[tuple[int, int], list[Spots]] = {}
    n = len(POINTS)
    known = well_known(markers.predicted.covariance)
    for k, camera in enumerate(views.names):
        sight = views.see(k, markers.predicted.xyz.reshape(-1, 3))
        spread = sight.by_point @ markers.predicted.covariance.reshape(-1, 3, 3) @ sight.by_point.swapaxes(-1, -2)
        wanted = known & window.delivered[:, k, None] & (markers.assigned.rays[..., k] < 0)
        steps, which = np.nonzero(wanted & sight.inside.reshape(-1, n))
        at = steps * n + which
        pulses = [window.candidates[t].pulse for t in steps.tolist()]
        places = sight.xy[at] - window.shift[steps, k]
        for t, spots in zip(
            steps.tolist(), look.look_for_spots(pulses, camera, places, spread[at] + sight.noise[at]), strict=True
        ):
            found.setdefault((t, k), []).append(spots)
    return found


def _parts(flight: Flight) -> list[Part]:
    """What the markers are made of (`_MIXING`)."""
    body = np.stack((flight.place(flight.middle_s + np.zeros(1))[0], flight.motion[1]))
    sigma = (ANYWHERE_M, _VELOCITY_M_S, _ACCELERATION_M_S2)
    gap = np.stack((_HALF_GAP_M * flight.axes[1], np.zeros(3)))
    return [
        Part(body, sigma, _LIMBS_M_S2),
        Part(body, sigma, _LIMBS_M_S2),
        Part(body, sigma, _FEET_M_S2),
        Part(gap, _GAP_SIGMA, _GAP_M_S2),
    ]


def _trusted(views: Views, named: Integers, window: Window, flight: Flight) -> Integers:
    """Names (t, 4) to begin with: of bindings those that are seen as a pair, which tell right from left themselves.

    Where there are hardly any pairs, one binding may have no marker. Then all points get the one name that is likelier
    by their side of the body and by the cameras that show them.
    """
    trusted = named.copy()
    both = (named[:, BINDINGS] >= 0).all(axis=1)
    trusted[~both, BINDINGS[0]] = trusted[~both, BINDINGS[1]] = -1
    if both.sum() >= _LEAST_PAIRS:
        return trusted
    body = (named[:, : _HIP + 1] >= 0).any(axis=1)
    alone = np.flatnonzero((named[:, BINDINGS] >= 0).any(axis=1) & ~both & body).tolist()
    if alone:
        left = [_rather_left(views, window, flight, t, named[t]) for t in alone]
        only = BINDINGS[1] if np.median(left) > 0 else BINDINGS[0]
        for t in alone:
            trusted[t, only] = named[t, BINDINGS].max()
    return trusted


def _rather_left(views: Views, window: Window, flight: Flight, t: int, named: Integers) -> float:
    """How much likelier a lone binding of pulse t is the left one than the right one, natural logarithm."""
    points, at = window.points[t], int(named[BINDINGS].max())
    place, body = points.xyz[at], np.mean([points.xyz[i] for i in named[: _HIP + 1] if i >= 0], axis=0)
    aside = float((place - body) @ flight.axes[1])
    chance = shown(views, place[None], flight.axes[1])[BINDINGS][:, points.rays[at] >= 0]
    right, left = np.log(chance).sum(axis=1)
    return float(2 * _HALF_GAP_M * aside / _ASIDE_M**2 + left - right)
