"""The skis of one jump: which traces show the right ski, which the left one, in every image.

In each pulse the traces of all images are assigned jointly: the lines in space must pass their bindings, and fit in
every view. Traces that could as well be the other ski, or both in one, stay without a name. Time makes it sharper: the
skis turn smoothly, and a binding marker keeps its place on its ski, so that pulses in which the skis lie apart tell
about those in which they are not.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from analysis.identification.over_time.assignment import DETECTED, MOST_VAGUE_M, jointly_best
from analysis.identification.over_time.flights import Flight
from analysis.identification.over_time.prediction import Part, Prediction, predict
from analysis.identification.over_time.window import Window
from analysis.identification.skis.beams import Beams
from analysis.identification.skis.ski_traces import Equations, Lines, SeenSkis, StraightTrace
from analysis.identification.space.views import Views, gate
from analysis.measurements.model import SIDES
from photogrammetry.jumper.stick_model import slope_and_heading
from rig.arrays import Flags, Floats, Integers

#: Slope and heading of skis against the horizontal direction of the flight, rad: standard deviations.
_SLOPE, _HEADING = np.radians(25.0), np.radians(15.0)
_BINDING_M = 0.06  #: standard deviation, across the ski, of a binding's marker from the ski's axis
_ALONG_M = 0.3  #: likewise along it
_STEADY_M = 0.01  #: standard deviation of that distance from pulse to pulse
#: Slope and heading (rad) of the right and the left ski as sums of their mean and of half their difference.
_MIXING = np.array([(1.0, -1.0), (1.0, 1.0)])
_PARTS = (
    Part(np.zeros((2, 2)), (0.4, 1.0, 10.0), 15.0),
    Part(np.zeros((2, 2)), (0.2, 0.5, 5.0), 8.0),
)
_MOST_TURNS = 6
_KNOWN_RAD = 0.1  #: standard deviation of a direction that tells a ski from a leg
_BEYOND_M = 0.35  #: more than a boot
LONGEST_M: Final = 1.4  #: from a binding to tail or tip: skis of 2.8 m
_LONGEST_SIGMA_M = 0.1  #: of that
_END_SIGMA_M = 0.06  #: of a visible end of a ski
_LEAST_TRACES = 8  #: of each ski that tell where its ends are
_WHOLE_M = 1.9  #: of a ski, in each of two images: no leg is so long, and skis of 2.2 m without their ends are
_CONTROLLED = 3  #: images of a ski that contradict each other if one is wrong
_FEWEST_SOUND = 3  #: pulses with each ski's own evidence: of two that contradict each other nobody knows which is wrong
_SURE_RAD = 0.035  #: standard deviation of a direction by which traces are judged: a shin is 20 degrees off
_LENGTH_PX = 40.0  #: of a trace, for the density of traces that are there by chance


@dataclass(frozen=True, slots=True, eq=False)
class Skis:
    """The skis of a jump.

    Attributes:
        traces: (t, 2, m) index of the straight trace of each side in each image; -1: none, or not to be told.
    """

    traces: Integers


@dataclass(frozen=True, slots=True, eq=False)
class Places:
    """Where the bindings are.

    Attributes:
        xyz: (t, 2, 3) of P3 and P4.
        covariance: (t, 2, 3, 3).
    """

    xyz: Floats
    covariance: Floats


def follow_skis(
    views: Views,
    window: Window,
    traces: Sequence[Sequence[Sequence[StraightTrace]]],
    flight: Flight,
    bindings: Places,
) -> Skis:
    """Find the traces of both skis.

    Args:
        views: the cameras.
        window: the pulses.
        traces: of each pulse by camera.
        flight: of the jumper.
        bindings: their places.
    """
    search = _Search(views, traces, window.delivered, flight, bindings)
    steps = len(window)
    angles = Prediction(
        np.zeros((steps, 2, 2)),
        np.broadcast_to(np.diag((_SLOPE**2, _HEADING**2)), (steps, 2, 2, 2)),
    )
    offsets = np.zeros((2, 2)), np.tile(_BINDING_M**2 * np.eye(2), (2, 1, 1))
    broad = search.belief(angles, offsets)
    found, believed = np.full((steps, 2, len(views)), -2), broad
    for _ in range(_MOST_TURNS):
        before, found = found, search.assigned(believed)
        if (found == before).all():
            break
        search.learn_ends(believed, found)
        lines = search.measured(broad, found)
        offsets = search.offsets(lines)
        angles = predict(window.time_s, *search.angles(lines), _PARTS, _MIXING)
        believed = search.belief(angles, offsets)
    return Skis(_borne_out(search, window.time_s, broad, found))


def assign_skis(
    views: Views,
    traces: Sequence[Sequence[Sequence[StraightTrace]]],
    delivered: Flags,
    flight: Flight,
    bindings: Places,
    angles: Prediction,
) -> Integers:
    """Assign traces to skis whose angles are predicted.

    Args:
        views: the cameras.
        traces: of t pulses by camera.
        delivered: (t, m) whether a camera has an image of a pulse.
        flight: of the jumper.
        bindings: their places.
        angles: (t, 2, 2) slope and heading of the right and the left ski in the frame of the flight, rad.

    Returns:
        (t, 2, m) index of the straight trace of each side in each image; -1: none, or not to be told.
    """
    search = _Search(views, traces, delivered, flight, bindings)
    anywhere = np.zeros((2, 2)), np.tile(_BINDING_M**2 * np.eye(2), (2, 1, 1))
    return search.assigned(search.belief(angles, anywhere))


def _borne_out(search: "_Search", time_s: Floats, broad: tuple[Floats, Floats], found: Integers) -> Integers:
    """The traces (t, 2, m) of skis that something bears out: their own images, or pulses of which these do.

    Two lines in two images are a line in space whatever they show, so a ski that rests on two traces, or on one, needs
    other evidence: that both show nearly the whole of it, or that skis which are borne out point the same way shortly
    before or after. A ski turns smoothly. One that a few pulses of the whole jump show is none.
    """
    sound = search.controlled(broad, found)
    sound &= np.count_nonzero(sound, axis=0) >= _FEWEST_SOUND
    while True:
        lines = search.measured(broad, np.where(sound[..., None], found, -1))
        angles = predict(time_s, *search.angles(lines), _PARTS, _MIXING)
        fits = (search.misfits(search.belief(angles, search.offsets(lines)), found) < gate(2)).all(axis=2)
        more = fits & _sure(angles) & (found >= 0).any(axis=2) & ~sound
        if not more.any():
            return np.where(sound[..., None], found, -1)
        sound |= more


def _sure(angles: Prediction) -> Flags:
    """Whether angles (t, 2) are predicted so well that they tell whether a trace is of their ski."""
    return np.asarray(np.linalg.eigvalsh(angles.covariance)[..., -1] < _SURE_RAD**2)


class _Search:
    """The assignment of traces in all pulses for given beliefs."""

    def __init__(
        self,
        views: Views,
        traces: Sequence[Sequence[Sequence[StraightTrace]]],
        delivered: Flags,
        flight: Flight,
        bindings: Places,
    ) -> None:
        self._views, self._delivered, self._flight, self._bindings = views, delivered, flight, bindings
        self._lines = [Lines.of([of_pulse[k] for of_pulse in traces]) for k in range(len(views))]
        sigma = np.sqrt(np.linalg.eigvalsh(np.nan_to_num(bindings.covariance, nan=1e6))[..., -1])
        self._known = sigma < MOST_VAGUE_M
        height = np.array([placed.size.min() for placed in views.placed])
        self._space = height * np.pi / 2 * _LENGTH_PX  # px^2 over which the ends of a trace may lie by chance
        self._ends = np.tile((-LONGEST_M, LONGEST_M), (2, 1))  # of each ski, m from its binding: tail and tip
        self._ends_sigma = _LONGEST_SIGMA_M

    def belief(self, angles: Prediction, offsets: tuple[Floats, Floats]) -> tuple[Floats, Floats]:
        """Values (t, 2, 6) and covariances (t, 2, 6, 6) of skis with angles (slope, heading) and offsets of markers.

        Args:
            angles: (t, 2, 2) slope and heading in the frame of the flight, rad.
            offsets: (2, 2) of the ski from its marker, to the left and up, with covariance (2, 2, 2), m.
        """
        slope, heading = np.clip(angles.xyz[..., 0], -1, 1), np.clip(angles.xyz[..., 1], -1, 1)
        direction, left, up = self._axes(slope, heading)
        values = np.concatenate(
            (
                self._bindings.xyz + offsets[0][None, :, :1] * left + offsets[0][None, :, 1:] * up,
                direction,
            ),
            axis=-1,
        )
        broad = np.diag((_SLOPE**2, _HEADING**2))
        inverse = np.linalg.inv(angles.covariance) + np.linalg.inv(broad) * 1e-3
        turning = np.linalg.inv(inverse)
        across = np.stack((up, np.cos(slope)[..., None] * left), axis=-1)
        aside = np.stack((left, up), axis=-1)
        covariance = np.zeros((*values.shape, 6))
        covariance[..., :3, :3] = self._bindings.covariance + aside @ offsets[1] @ aside.swapaxes(-1, -2)
        covariance[..., :3, :3] += _ALONG_M**2 * direction[..., :, None] * direction[..., None, :]
        covariance[..., 3:, 3:] = across @ turning @ across.swapaxes(-1, -2)
        return values, covariance

    def _axes(self, slope: Floats, heading: Floats) -> tuple[Floats, Floats, Floats]:
        """Direction, left and up (..., 3) of skis in the object system."""
        zero = np.zeros_like(slope)
        local = (
            (np.cos(slope) * np.cos(heading), np.cos(slope) * np.sin(heading), np.sin(slope)),
            (-np.sin(heading), np.cos(heading), zero),
            (-np.sin(slope) * np.cos(heading), -np.sin(slope) * np.sin(heading), np.cos(slope)),
        )
        direction, left, up = (np.stack(part, axis=-1) @ self._flight.axes for part in local)
        return direction, left, up

    def assigned(self, belief: tuple[Floats, Floats]) -> Integers:
        """Traces (t, 2, m) of the skis."""
        values, spread = belief[0].reshape(-1, 6), belief[1].reshape(-1, 6, 6)
        beams = Beams.begun(np.flatnonzero(self._known.ravel()), spread, len(self._views))
        for k, sight in enumerate(self._views.see_all(SeenSkis.places(values))):
            beams = self._continued(beams, k, SeenSkis(sight), spread)
        found = np.full((*self._known.shape, len(self._views)), -1)
        for t in np.flatnonzero(self._known.any(axis=1)).tolist():
            options = [beams.options(2 * t + side) for side in range(len(SIDES))]
            for side, (option, doubtful) in enumerate(jointly_best(options)):
                found[t, side] = np.where(doubtful, -1, option.rays)
        return found

    def _continued(self, beams: Beams, k: int, seen: SeenSkis, spread: Floats) -> Beams:
        """Hypotheses with the traces of one more camera."""
        lines = self._lines[k]
        usable = self._known & self._delivered[:, k, None] & seen.inside.reshape(self._known.shape)
        line, side = np.nonzero(usable[lines.step])
        skis = 2 * lines.step[line] + side
        equations = seen.equations(skis, lines.only(line))
        beyond = self._beyond(equations, side)
        near = np.flatnonzero(_near(equations, spread[skis]) & (beyond < gate(2)))
        chance = (np.bincount(lines.step, minlength=len(usable)) + 1) / self._space[k]
        rate = 2 * np.log(2 * np.pi * chance / DETECTED) + 2 * np.log(1 - DETECTED)
        extra = beyond[near] + rate[lines.step[line[near]]]
        return beams.longer(k, skis[near], lines.place[line[near]], equations.only(near), extra)

    def _beyond(self, equations: Equations, side: Integers) -> Floats:
        """Chi-squares (n,) of traces reaching beyond tail or tip of a ski; that they may be shorter costs nothing."""
        tail, tip = self._ends[side].T
        over = np.maximum(0.0, tail - equations.along.min(axis=1)), np.maximum(0.0, equations.along.max(axis=1) - tip)
        return np.asarray((over[0] ** 2 + over[1] ** 2) / self._ends_sigma**2)

    def learn_ends(self, belief: tuple[Floats, Floats], found: Integers) -> None:
        """Where tail and tip are, from the longest of the traces that were found; they stay there all the jump."""
        sides, along = [], []
        for k in range(found.shape[2]):
            t, side = np.nonzero(found[..., k] >= 0)
            sides.append(side)
            along.append(self._equations(k, belief[0], found, t, side).along)
        side, reach = np.concatenate(sides), np.concatenate(along)
        if np.bincount(side, minlength=len(SIDES)).min() < _LEAST_TRACES:
            return
        for i in range(len(SIDES)):
            own = reach[side == i]
            self._ends[i] = np.quantile(own.min(axis=1), 0.25), np.quantile(own.max(axis=1), 0.75)
        self._ends_sigma = _END_SIGMA_M

    def measured(self, belief: tuple[Floats, Floats], found: Integers) -> tuple[Floats, Floats, Flags]:
        """Skis (t, 2, 6) with covariance, by their traces with little prior; (t, 2) which have two views or more."""
        state, covariance = np.zeros_like(belief[0]), belief[1].copy()
        known = np.asarray((found >= 0).sum(axis=2) >= 2)
        for k in range(found.shape[2]):
            t, side = np.nonzero(known & (found[..., k] >= 0))
            equations = self._equations(k, belief[0], found, t, side)
            state[t, side], covariance[t, side] = equations.updated(state[t, side], covariance[t, side])
        return belief[0] + state, covariance, known

    def controlled(self, belief: tuple[Floats, Floats], found: Integers) -> Flags:
        """Skis (t, 2) that three images show, or two that both show nearly the whole of it."""
        values = self.measured(belief, found)[0]
        values[..., 3:] /= np.linalg.norm(values[..., 3:], axis=-1, keepdims=True)
        whole = np.zeros(found.shape, bool)
        for k in range(found.shape[2]):
            t, side = np.nonzero(found[..., k] >= 0)
            whole[t, side, k] = np.ptp(self._equations(k, values, found, t, side).along, axis=1) > _WHOLE_M
        return np.asarray(((found >= 0).sum(axis=2) >= _CONTROLLED) | (whole.sum(axis=2) > 1))

    def misfits(self, belief: tuple[Floats, Floats], found: Integers) -> Floats:
        """Chi-squares (t, 2, m), of two degrees of freedom, of each trace as one of the ski that is believed in."""
        squares = np.zeros(found.shape)
        for k in range(found.shape[2]):
            t, side = np.nonzero(found[..., k] >= 0)
            equations = self._equations(k, belief[0], found, t, side)
            squares[t, side, k] = equations.misfit(np.zeros((len(t), 6)), belief[1][t, side])[0]
        return squares

    def _equations(self, k: int, values: Floats, found: Integers, t: Integers, side: Integers) -> Equations:
        """What the traces of some skis that were found in a camera say about them."""
        lines = self._lines[k].at(t, found[t, side, k])
        sight = self._views.see(k, SeenSkis.places(values.reshape(-1, 6)))
        return SeenSkis(sight).equations(2 * t + side, lines)

    def angles(self, lines: tuple[Floats, Floats, Flags]) -> tuple[Floats, Floats]:
        """Slope and heading (t, 2, 2) of measured skis with covariance; NaN where not measured."""
        values, covariance, known = lines
        local = values[..., 3:] @ self._flight.axes.T
        x, y, z = np.moveaxis(local, -1, 0)
        level = np.hypot(x, y)
        angles = slope_and_heading(local)
        square = level**2 + z**2
        by_slope = np.stack((-z * x / level, -z * y / level, level), axis=-1) / square[..., None]
        by_heading = np.stack((-y, x, np.zeros_like(x)), axis=-1) / (level**2)[..., None]
        jacobian = np.stack((by_slope, by_heading), axis=-2) @ self._flight.axes
        spread = jacobian @ covariance[..., 3:, 3:] @ jacobian.swapaxes(-1, -2)
        angles[~known], spread[~known] = np.nan, np.nan
        return angles, spread

    def offsets(self, lines: tuple[Floats, Floats, Flags]) -> tuple[Floats, Floats]:
        """Offsets (2, 2) of the skis from their markers, to the left and up, with covariance (2, 2, 2), m."""
        values, covariance, known = lines
        angles, _ = self.angles(lines)
        _, left, up = self._axes(np.nan_to_num(angles[..., 0]), np.nan_to_num(angles[..., 1]))
        aside = np.stack((left, up), axis=-2)
        off = (aside @ (values[..., :3] - self._bindings.xyz)[..., None])[..., 0]
        prior = np.linalg.inv(_BINDING_M**2 * np.eye(2))
        mean, spread = np.zeros((2, 2)), np.tile(_BINDING_M**2 * np.eye(2), (2, 1, 1))
        for side in range(2):
            own = known[:, side]
            # The offsets were pulled by their prior; without it they weigh by what the traces alone say.
            total = aside[own, side] @ covariance[own, side, :3, :3] @ aside[own, side].swapaxes(-1, -2)
            total = total + _STEADY_M**2 * np.eye(2)
            weight = np.linalg.inv(total)
            spread[side] = np.linalg.inv(prior + weight.sum(axis=0))
            mean[side] = spread[side] @ (weight @ off[own, side][..., None]).sum(axis=0)[:, 0]
        return mean, spread + _STEADY_M**2 * np.eye(2)


def _near(equations: Equations, covariance: Floats) -> Flags:
    """Whether traces may be skis with covariances (n, 6, 6).

    As long as the direction of a ski is hardly known, a leg that ends at the binding may look like half a ski. Then
    the trace must reach beyond the binding to both sides.
    """
    near = equations.near(covariance)
    near &= equations.misfit(np.zeros((len(near), 6)), covariance)[0] <= gate(2)
    known = np.linalg.eigvalsh(covariance[:, 3:, 3:])[:, -1] < _KNOWN_RAD**2
    both = (equations.along.min(axis=1) < -_BEYOND_M) & (equations.along.max(axis=1) > _BEYOND_M)
    return np.asarray(near & (known | both))
