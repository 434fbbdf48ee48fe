"""Where the bindings are by the skis alone: for jumpers whose bindings have no name, or whose names lead to no skis.

Helmet and hip tell about where the feet are. From there both skis are sought in space in some of the pulses, and what
moves as feet do tells their places in all pulses.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np

from analysis.candidates.model import SecondLook
from analysis.identification.markers.markers import Markers, nearest_known, with_bindings
from analysis.identification.over_time.flights import Flight
from analysis.identification.over_time.window import Window
from analysis.identification.ski_bars import MeasuredSkis, ski_views
from analysis.identification.space.body import BINDINGS, usual_difference
from analysis.identification.space.views import Views
from analysis.measurements.model import SIDES
from analysis.ski_bars.bars import OF_POSE, SKIS, USUAL_SHAPE, USUAL_SHAPE_SIGMA, ExpectedBars, Poses
from analysis.ski_bars.fitting import FittedBars, fit_bars
from analysis.ski_bars.pairs import Feet, seek_pairs
from analysis.ski_bars.pixels import SkiView
from rig.arrays import Flags, Floats

_BODY: Final = [0, 1]  #: indices of helmet and hip in `POINTS`
_KNOWN_M: Final = 0.3  #: standard deviation of a place from which on it is no use for the feet
_SEARCHES: Final = 20  #: pulses in which skis are sought, about
#: Standard deviations of a ski found by lines: its place, m, forward, to the left (cameras beside the hill see that
#: worst) and up; its direction, rad.
_FOUND_M, _FOUND_RAD = np.array((0.15, 0.2, 0.08)), np.radians(5.0)
_ALONG_M, _ACROSS_M = 0.1, 0.02  #: of a binding from its place on a fitted ski
#: Logarithm of how much likelier than none a ski is in a pulse that shows it.
_GAIN: Final = 5.0
_MARKER_M, _SIGMAS = 0.06, 3.0  #: of a binding's marker from the axis of its ski, and at most
_FEWEST: Final = 3  #: pulses that show both skis
#: Share of the pairs found by lines that fits must confirm: where they refuse most, the rest is chance.
_CONFIRMED: Final = 0.5
_IMAGES: Final = 2


def beside_skis(views: Views, window: Window, flight: Flight, markers: Markers, look: SecondLook) -> Markers | None:
    """The markers with bindings where skis are that are sought without them; None where hardly any are found.

    Args:
        views: the cameras.
        window: t pulses.
        flight: of the jumper.
        markers: as named.
        look: at the images.
    """
    feet, covariance, known = _feet(markers, flight)
    steps = np.flatnonzero(known & window.delivered.any(axis=1))
    steps = steps[:: max(1, len(steps) // _SEARCHES)]
    if len(steps) < _FEWEST:
        return None
    apart, sigma = usual_difference(*BINDINGS)
    about = Feet(feet[steps], covariance[steps], apart @ flight.axes, sigma)
    pulses = [ski_views(views, window, flight, t, look) for t in steps.tolist()]
    pairs = seek_pairs(pulses, about, window.time_s[steps], flight.axes)
    sure = np.flatnonzero((pairs.gain > _GAIN).all(axis=1))
    xyz, spread = np.full((len(sure), SKIS, 3), np.nan), np.zeros((len(sure), SKIS, 3, 3))
    for i, t in enumerate(sure.tolist()):
        fit = _fitted(pulses[t], Poses(pairs.point[t], pairs.direction[t]), flight.axes)
        for k in np.flatnonzero(fit.seen).tolist():
            place = slice(OF_POSE * k, OF_POSE * k + 3)
            along = fit.poses.direction[k]
            xyz[i, k] = fit.poses.point[k]
            spread[i, k] = (
                fit.covariance[place, place] + _ALONG_M**2 * np.outer(along, along) + _ACROSS_M**2 * np.eye(3)
            )
    both = np.count_nonzero(np.isfinite(xyz).all(axis=(1, 2)))
    if both < max(_FEWEST, _CONFIRMED * len(sure)):
        return None
    return with_bindings(window, flight, markers, steps[sure], xyz, spread)


def _fitted(views: Sequence[SkiView], poses: Poses, axes: Floats) -> FittedBars:
    """Both skis of a pulse, from where they were found by lines."""
    covariance = np.zeros((SKIS * OF_POSE,) * 2)
    for k in range(SKIS):
        place, turns = slice(OF_POSE * k, OF_POSE * k + 3), slice(OF_POSE * k + 3, OF_POSE * (k + 1))
        covariance[place, place] = (axes.T * _FOUND_M**2) @ axes
        covariance[turns, turns] = _FOUND_RAD**2 * np.eye(2)
    shape, sigma = np.tile(USUAL_SHAPE, (SKIS, 1)), np.tile(USUAL_SHAPE_SIGMA, (SKIS, 1))
    return fit_bars(views, ExpectedBars(poses, covariance, shape, sigma))


def _feet(markers: Markers, flight: Flight) -> tuple[Floats, Floats, Flags]:
    """Places (t, 3) between both bindings by helmet and hip, covariances, and where there is one (t,)."""
    at = markers.places(_BODY)
    known: Flags = np.asarray(np.linalg.eigvalsh(at.covariance)[..., -1] < _KNOWN_M**2)
    own: list[Floats] = []
    weight, right = np.zeros((len(known), 3, 3)), np.zeros((len(known), 3, 1))
    for k, i in enumerate(_BODY):
        means, (sigma, _) = zip(*(usual_difference(i, binding) for binding in BINDINGS), strict=True)
        spread = at.covariance[:, k] + (flight.axes.T * sigma**2) @ flight.axes
        inverse = np.where(known[:, k, None, None], np.linalg.inv(spread), 0.0)
        weight += inverse
        own.append((at.xyz[:, k] + np.mean(means, axis=0) @ flight.axes)[..., None])
        right += inverse @ own[-1]
    told: Flags = np.asarray(known.any(axis=1))
    weight[~told] = np.eye(3)
    xyz = np.linalg.solve(weight, right)
    # one of both may be something else on the jumper
    off = np.where(np.asarray(known.all(axis=1))[:, None, None], (own[1] - own[0]) / 2, 0.0)
    spread = np.linalg.inv(weight) + off @ off.swapaxes(1, 2)
    return np.asarray(xyz[..., 0], float), np.asarray(spread, float), told


def off_skis(views: Views, window: Window, markers: Markers, skis: Sequence[MeasuredSkis]) -> Flags:
    """Which bindings (t, 2) lie off their skis; a pulse without both is judged as the next pulse that shows both."""
    told, off = np.zeros((2, len(window), SKIS), bool)
    for t, of_pulse in enumerate(skis):
        for k, name in enumerate(views.names):
            for i, side in enumerate(SIDES):
                spot, ski = int(markers.assigned.rays[t, BINDINGS[i], k]), of_pulse.get(name, {}).get(side)
                if spot < 0 or ski is None:
                    continue
                way = ski.xy[1] - ski.xy[0]
                xy = window.candidates[t].images[name].spots.xy[spot] - ski.xy[0]
                aside = abs(float(way[0] * xy[1] - way[1] * xy[0])) / float(np.hypot(*way))
                told[t, i] = True
                off[t, i] |= aside > _SIGMAS * _MARKER_M * views.scale[k]
    for i in range(SKIS):
        if told[:, i].any():
            off[:, i] = off[nearest_known(told[:, i]), i]
    return off


def shown_by_two(skis: Sequence[MeasuredSkis]) -> int:
    """How many skis two images show, of all pulses."""
    return sum(sum(side in of for of in images.values()) >= _IMAGES for images in skis for side in SIDES)
