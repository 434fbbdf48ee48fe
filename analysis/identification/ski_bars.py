"""The skis of one jump: where the bindings are is known, so they are sought and fitted as bars in space.

Their directions are sought through all pulses at once. From there both skis of a pulse are fitted in all images that
show them: at first in the most telling pulses, which tell how long they are and how each stands to the marker of its
binding, both the same all the jump; then in all. A ski turns smoothly: a pulse that contradicts the others is left out.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final

import numpy as np

from analysis.candidates.model import SecondLook
from analysis.identification.over_time.flights import Flight
from analysis.identification.over_time.window import Window
from analysis.identification.ski_turns import FEWEST_TELLING, SOUGHT_RAD, led, smooth
from analysis.identification.space.body import BINDINGS, usual_difference
from analysis.identification.space.views import Views
from analysis.measurements.model import SIDES, SkiMeasurement
from analysis.ski_bars.bars import OF_POSE, SKIS, USUAL_SHAPE, USUAL_SHAPE_SIGMA, ExpectedBars, Poses
from analysis.ski_bars.directions import SHARP_M, is_sharp, seek_directions
from analysis.ski_bars.fitting import FittedBars, fit_bars
from analysis.ski_bars.pixels import Legs, SkiView
from rig.arrays import Flags, Floats

#: Skis by side in each camera of a pulse.
MeasuredSkis = Mapping[str, Mapping[str, SkiMeasurement]]

_VAGUE_M: Final = 0.2  #: standard deviation of the place of a binding from which its ski is sought through all pulses
_FEWEST: Final = 2  #: images that show a binding
_BINDING_M: Final = 0.06  #: of a binding's marker from the axis of its ski, in any direction
_STEADY_M: Final = 0.015  #: of that distance from pulse to pulse
_PASSES: Final = 3  #: over the pulses, each from where the last one leads
_TELLING: Final = 12  #: pulses that tell how long the skis are
_BY_CHANCE: Final = 0.1  #: share of the pulses in which what is no ski may be fitted as one
_SHAPE_M: Final = (0.005, 0.03, 0.03)  #: what bend and visible ends differ by from pulse to pulse


@dataclass(frozen=True, slots=True, eq=False)
class Bindings:
    """Where the bindings are.

    Attributes:
        xyz: (t, 2, 3) of P3 and P4, or (2, 3) at one pulse.
        covariance: (t, 2, 3, 3), or (2, 3, 3).
    """

    xyz: Floats
    covariance: Floats

    def at(self, t: int) -> "Bindings":
        """At one pulse."""
        return Bindings(self.xyz[t], self.covariance[t])

    def side_by_side(self, axes: Floats) -> "Bindings":
        """The same (t, 2, 3); one that is not known lies beside the other one, as feet do.

        Args:
            axes: (3, 3) forward, left and up as rows.
        """
        mean, sigma = usual_difference(*BINDINGS)
        apart, spread = mean @ axes, (axes.T * sigma**2) @ axes
        xyz, covariance, sharp = self.xyz.copy(), self.covariance.copy(), is_sharp(self.covariance)
        for k in range(SKIS):
            vague = ~sharp[:, k] & sharp[:, 1 - k]
            xyz[vague, k] = self.xyz[vague, 1 - k] + (apart if k else -apart)
            covariance[vague, k] = self.covariance[vague, 1 - k] + spread
        return Bindings(xyz, covariance)


def measure_skis(
    views: Views, window: Window, flight: Flight, bindings: Bindings, hips: Bindings, look: SecondLook, steps: Flags
) -> list[MeasuredSkis]:
    """Measure both skis in the images of a window.

    Args:
        views: the cameras.
        window: t pulses.
        flight: of the jumper.
        bindings: their places.
        hips: places of the hip (t, 1).
        look: at the images.
        steps: (t,) the pulses in which they are wanted.

    Returns:
        Of each pulse.
    """
    bindings = bindings.side_by_side(flight.axes)
    pulses = [
        ski_views(views, window, flight, t, look, legs(bindings.at(t), hips.at(t))) if steps[t] else []
        for t in range(len(window))
    ]
    known = np.array([sought_from(of, bindings.at(t), _VAGUE_M) for t, of in enumerate(pulses)])
    # What is seen from a vague place alone may be the other ski.
    known &= (known & is_sharp(bindings.covariance)).any(axis=1, keepdims=True)
    if not known.any():
        return [{} for _ in pulses]
    sought = seek_directions(pulses, bindings.xyz, bindings.covariance, known, window.time_s, flight.axes)
    pair = SkiPair()
    turning = np.tile(np.diag(SOUGHT_RAD**2), (SKIS, 1, 1))

    def fitted(t: int, direction: Floats) -> FittedBars:
        return pair.fitted(pulses[t], bindings.at(t), direction, turning, known[t])

    telling = [int(t) for t in np.argsort(-sought.gain.sum(axis=1))[:_TELLING] if known[t].any()]
    pair.learn([(fitted(t, sought.direction[t]), bindings.at(t)) for t in telling])
    found = [fitted(t, sought.direction[t]) if known[t].any() else None for t in range(len(window))]
    for _ in range(_PASSES):
        seen = smooth(found, window.time_s, flight)
        toward, leads = led(found, seen, window.time_s, flight)
        leads &= known & ~seen
        more = False
        for t, fit in enumerate(found):
            if fit is None or not leads[t].any():
                continue
            again = fitted(t, np.where(leads[t, :, None], toward[t], fit.poses.direction))
            if sum(again.seen) >= sum(fit.seen) and not np.any(seen[t] & ~np.array(again.seen)):
                more |= sum(again.seen) > sum(fit.seen)
                found[t] = again
        if not more:
            break
    seen = smooth(found, window.time_s, flight)
    seen &= seen.sum(axis=0) > _BY_CHANCE * known.sum(axis=0)
    return [{} if fit is None else measured(fit, own) for fit, own in zip(found, seen, strict=True)]


def legs(bindings: Bindings, hips: Bindings) -> Legs:
    """The legs of a pulse, as far as feet and hip are known, perhaps vaguely."""
    sigma = [np.sqrt(np.linalg.eigvalsh(of.covariance)[:, -1]) for of in (bindings, hips)]
    known = (sigma[0] < _VAGUE_M) & (sigma[1] < _VAGUE_M)
    ends = np.stack((bindings.xyz, np.tile(hips.xyz, (SKIS, 1))), axis=1)
    return Legs(ends[known], np.column_stack(np.broadcast_arrays(*sigma))[known])


def ski_views(
    views: Views, window: Window, flight: Flight, t: int, look: SecondLook, legs: Legs | None = None
) -> list[SkiView]:
    """The images of a pulse of a window, in which legs may lie before skis."""
    pulse, velocity = window.candidates[t].pulse, flight.velocity(window.time_s[t : t + 1])[0]
    return [
        SkiView(placed, partial(look.part, pulse, name), velocity * window.late_s[k], legs or Legs())
        for k, (name, placed) in enumerate(zip(views.names, views.placed, strict=True))
        if window.delivered[t, k]
    ]


def sought_from(views: Sequence[SkiView], bindings: Bindings, sigma_m: float = SHARP_M) -> Flags:
    """Of which skis (2,) a binding is known better than `sigma_m`, and shown by enough cameras to seek it."""
    known = np.linalg.eigvalsh(bindings.covariance)[:, -1] < sigma_m**2
    count = np.zeros(SKIS)
    for view in views:
        px = view.camera.project(bindings.xyz + view.shift)
        count += ((px >= 0) & (px <= view.camera.size - 1)).all(axis=1)
    return np.asarray(known & (count >= _FEWEST))


class SkiPair:
    """What is known of the skis of a jump: how long and how bent they are, and how each stands to its marker."""

    def __init__(self) -> None:
        self._shape, self._shape_sigma = np.tile(USUAL_SHAPE, (SKIS, 1)), np.tile(USUAL_SHAPE_SIGMA, (SKIS, 1))
        self._offset, self._offset_sigma = np.zeros((SKIS, 3)), np.full(SKIS, _BINDING_M)

    def fitted(
        self, views: Sequence[SkiView], bindings: Bindings, direction: Floats, turning: Floats, known: Flags
    ) -> FittedBars:
        """Both skis of a pulse.

        Args:
            views: images of the pulse.
            bindings: (2,) their places.
            direction: (2, 3) expected.
            turning: (2, 2, 2) covariance of that, of turns to the side and in the vertical plane, rad^2.
            known: (2,) which ski is expected.
        """
        direction = np.where(known[:, None], direction, direction[::-1])
        point = bindings.xyz + (self._offset[:, None] @ _frames(direction))[:, 0]
        covariance = np.zeros((SKIS * OF_POSE, SKIS * OF_POSE))
        for k in range(SKIS):
            place = slice(OF_POSE * k, OF_POSE * k + 3)
            turns = slice(place.stop, place.stop + 2)
            covariance[place, place] = bindings.covariance[k] + self._offset_sigma[k] ** 2 * np.eye(3)
            covariance[turns, turns] = turning[k]
        expected = ExpectedBars(Poses(point, direction), covariance, self._shape, self._shape_sigma)
        return fit_bars(views, expected, (bool(known[0]), bool(known[1])), near=True)

    def learn(self, seen: Sequence[tuple[FittedBars, Bindings]]) -> None:
        """Learn from some pulses: skis as fitted, and the places (2,) of the markers of their bindings."""
        for k in range(SKIS):
            own = [(fit, at) for fit, at in seen if fit.seen[k]]
            if len(own) < FEWEST_TELLING:
                continue
            self._shape[k], self._shape_sigma[k] = np.median([fit.shape[k] for fit, _ in own], axis=0), _SHAPE_M
            marked = [(fit, at.xyz[k]) for fit, at in own if is_sharp(at.covariance[k])]
            if len(marked) < FEWEST_TELLING:
                continue
            off = [_frames(fit.poses.direction)[k] @ (fit.poses.point[k] - xyz) for fit, xyz in marked]
            self._offset[k], self._offset_sigma[k] = np.median(off, axis=0), _STEADY_M


def _frames(direction: Floats) -> Floats:
    """Unit vectors (2, 3, 3) along each ski, to the side and in the vertical plane, as rows."""
    aside, normal = Poses(np.zeros((SKIS, 3)), direction).axes()
    return np.stack((direction, aside, normal), axis=1)


def measured(fit: FittedBars, seen: Flags) -> MeasuredSkis:
    """What the images of a pulse show of those skis that are seen (2,)."""
    return {
        camera: {
            side: SkiMeasurement(line.xy, np.full(2, line.sigma), lasting=line.lasting)
            for k, side in enumerate(SIDES)
            if seen[k] and (line := lines[k]) is not None
        }
        for camera, lines in fit.lines.items()
    }
