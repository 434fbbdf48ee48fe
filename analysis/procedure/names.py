"""Which of a jump's markers its measurements tell by name.

Helmet, hip and bindings look alike, and gloves, knees, elbows or light seams can look like them. A helmet and two
gloves are as far from each other as a helmet and bindings may be, and a helmet that is never found leaves its name to
the hip. So each name must be borne out, in several pulses, by what nothing else on a body does (decision 0067).
"""

from collections.abc import Collection, Sequence
from dataclasses import replace
from itertools import combinations
from typing import Final

import numpy as np

from analysis.identification.space.body import USUAL, implausibility, log_spread
from analysis.measurements.model import BINDING_OF, POINTS, SIDES, ImageMeasurements, JumpMeasurements
from analysis.motion.quantities import NEEDS
from analysis.result.model import QUANTITIES, JumperState, SmoothedState, Status
from rig.arrays import Floats
from rig.phrase import Phrase, phrase

#: What is said of a jump of which nothing is given.
UNTOLD: Final = phrase(
    "jump_untold",
    "which marker is which cannot be told, so none is given: helmet and hip are hardly ever seen together, nor all "
    "four, and no binding on its ski; look at the overlay, and give the markers more contrast",
)
_BODY: Final = ("P1", "P2")
_BINDINGS: Final = tuple((binding, side) for side, binding in BINDING_OF.items())
_PULSES_LEAST: Final = 3  #: pulses that bear a name out; in one or two it may be a coincidence
_SIGMAS: Final = 3.0  #: of the angle between both skis, so that it is beyond doubt
_AHEAD_M: Final = 0.1  #: the feet of a jumper are side by side; of what lies farther ahead one is no binding


def told_names(states: Sequence[JumperState]) -> frozenset[str]:
    """The names of points and skis that the raw states of a jump bear out; all points if a person measured any.

    - Helmet and hip by each other: nothing else that goes with a body is as far from each other in that direction.
    - A binding by its ski. Where hardly any ski was found, bindings by all four at once, if they look like a body.
    - The helmet without the hip, or the other way round, by told bindings: it is where it must be beside them, and in
      several pulses the other one would hardly be there. A hip in the crouch on the table may as well be a helmet, in
      flight a helmet is farther from the bindings; and never is a hip where a helmet is then.
    - Skis by each other, where the left one points to the left of the right one: nothing else opens forwards like that.
      A binding tells its own ski and the other one.

    Bindings of which one lies ahead of the other along the skis are not told: one of them is something else. Nor is a
    binding that lies, as seen from helmet or hip, where the other one is expected: of a single one both may be said.
    """
    points = [point for state in states for point in state.points.values() if point is not None]
    if any(point.status is Status.BY_HAND for point in points):
        return frozenset((*POINTS, *SIDES))
    body = _Body(states)
    told: set[str] = set()
    if body.looks(_BODY):
        told.update(_BODY)
    on_ski = {p: sum(s.points[p] is not None and s.skis[side] is not None for s in states) for p, side in _BINDINGS}
    if max(on_ski.values()) >= _PULSES_LEAST:
        told.update(p for p, count in on_ski.items() if count >= _PULSES_LEAST and not body.contradicts(p, told))
    if sum(None not in state.points.values() for state in states) >= _PULSES_LEAST and all(
        map(body.looks, combinations(POINTS, 2))
    ):
        told.update(POINTS)
    if _ahead_m(states) > _AHEAD_M:
        told.difference_update(p for p, _ in _BINDINGS)
    told.difference_update([p for p, _ in _BINDINGS if p in told and body.looks_like_the_other_side(p)])
    if not told.issuperset(_BODY) and not body.contradicts(_BODY[0], _BODY[1:]):
        bindings = told.intersection(p for p, _ in _BINDINGS)
        for name, other in (_BODY, _BODY[::-1]):
            if any(body.looks((binding, name)) and body.rather((binding, name), other) for binding in bindings):
                told.add(name)
    if any(binding in told for binding, _ in _BINDINGS) or _opens(states):
        told.update(SIDES)
    return frozenset(told)


def _opens(states: Sequence[JumperState]) -> bool:
    """Whether skis open forwards, beyond doubt in several pulses, and in most of those that show both."""
    opening = []
    for state in states:
        right, left = (state.skis[side] for side in SIDES)
        if right is not None and left is not None:
            apart = (left.heading.value - right.heading.value + 180.0) % 360.0 - 180.0
            opening.append(apart / float(np.hypot(left.heading.sigma, right.heading.sigma)))
    beyond = np.sum(np.array(opening) > _SIGMAS) >= _PULSES_LEAST
    return bool(beyond and np.median(opening) > 0.0)


def _ahead_m(states: Sequence[JumperState]) -> float:
    """How far one binding lies ahead of the other along the skis, median over the pulses that show all four, m.

    0 where hardly any pulse shows them.
    """
    ahead = []
    for state in states:
        right, left, (one, other) = state.points["P3"], state.points["P4"], (state.skis[side] for side in SIDES)
        if right is not None and left is not None and one is not None and other is not None:
            along = one.direction + other.direction
            ahead.append(abs(float((left.xyz - right.xyz) @ along)) / float(np.linalg.norm(along)))
    return float(np.median(ahead)) if len(ahead) >= _PULSES_LEAST else 0.0


def untold_line(states: Sequence[JumperState], told: Collection[str]) -> Phrase | None:
    """What is said of the points that are not given; None if all that were measured are."""
    untold = [name for name in POINTS if name not in told and any(state.points[name] is not None for state in states)]
    if not untold:
        return None
    if not told:
        return UNTOLD
    points = ", ".join(untold)
    rest = (
        "not given: what was measured there may be something else on the jumper; look at the overlay, and give the "
        "markers more contrast"
    )
    if len(untold) == 1:
        return phrase("jump_untold_point", "{points} is " + rest, points=points)
    which = " and ".join(points.rsplit(", ", 1))
    return phrase("jump_untold_points", "{which} are " + rest, which=which, points=points)


def untold_parts(told: Collection[str]) -> frozenset[str]:
    """Points and skis that are not given where only some names are told."""
    return frozenset((*POINTS, *SIDES)).difference(told)


def only_told(jump: JumpMeasurements, told: Collection[str]) -> JumpMeasurements:
    """The jump without `untold_parts`."""
    untold = untold_parts(told)
    pulses = (
        replace(
            pulse,
            images={
                camera: ImageMeasurements(
                    {name: point for name, point in image.points.items() if name not in untold},
                    {side: ski for side, ski in image.skis.items() if side not in untold},
                )
                for camera, image in pulse.images.items()
            },
        )
        for pulse in jump.pulses
    )
    return replace(jump, pulses=tuple(pulses))


def measured_parts(state: JumperState) -> JumperState:
    """Of a state from the model over time, what was measured at its own pulse, without quantities."""
    return JumperState(
        {
            name: None if point is None or point.status is Status.PREDICTED else point
            for name, point in state.points.items()
        },
        {side: None if ski is None or ski.status is Status.PREDICTED else ski for side, ski in state.skis.items()},
        {},
        None,
        None,
    )


def told_state(state: SmoothedState, told: Collection[str]) -> SmoothedState:
    """A state without the points that are not told, and without what follows from them."""
    untold = untold_parts(told)
    missing = [not untold.isdisjoint(NEEDS.get(name, ())) for name in QUANTITIES]
    lost = {name for name, gone in zip(QUANTITIES, missing, strict=True) if gone}
    return replace(
        state,
        points={name: None if name in untold else point for name, point in state.points.items()},
        skis={side: None if side in untold else ski for side, ski in state.skis.items()},
        angles={name: None if name in lost else angle for name, angle in state.angles.items()},
        height=None if "height" in lost else state.height,
        speed=None if "speed" in lost else state.speed,
        angle_of_attack=None if "angle_of_attack" in lost else state.angle_of_attack,
        by_calibration=np.where(np.array(missing)[:, None], np.nan, state.by_calibration),
    )


class _Body:
    """How the points of a jump lie to each other, in the frame of the flight.

    Args:
        states: raw states of its pulses.
    """

    def __init__(self, states: Sequence[JumperState]) -> None:
        places = [[point and point.xyz for point in map(state.points.get, POINTS)] for state in states]
        found = np.array([[np.full(3, np.nan) if xyz is None else xyz for xyz in of] for of in places], float)
        found = found.reshape(-1, len(POINTS), 3)
        self._xyz = found @ _axes(found).T

    def looks(self, pair: tuple[str, str], second: str | None = None) -> bool:
        """Whether two points look like what they are named in most of several pulses.

        Args:
            pair: the points.
            second: another name for the second one.
        """
        squares = self._squares(pair, second)
        return len(squares) >= _PULSES_LEAST and float(np.median(squares)) < USUAL

    def rather(self, pair: tuple[str, str], second: str) -> bool:
        """Whether the second point of a pair is what it is named rather than `second`.

        Poses of one body over a jump are no independent draws, so that likelihoods are not multiplied: the pulses that
        tell the two apart best decide, and most others must not say otherwise.
        """
        one, other = map(POINTS.index, pair)
        more = log_spread(one, POINTS.index(second)) - log_spread(one, other)
        ratios = self._squares(pair, second) - self._squares(pair) + more
        telling = len(ratios) >= _PULSES_LEAST and float(np.sort(ratios)[-_PULSES_LEAST]) >= USUAL
        return bool(telling and np.median(ratios) > 0.0)

    def looks_like_the_other_side(self, binding: str) -> bool:
        """Whether a binding lies to helmet or hip as the other binding does, in most of several pulses."""
        other = next(name for name, _ in _BINDINGS if name != binding)
        pairs = [(name, binding) for name in _BODY]
        found = [self._squares(pair, other) - self._squares(pair) for pair in pairs]
        return any(len(more) >= _PULSES_LEAST and float(np.median(more)) < 0.0 for more in found)

    def contradicts(self, name: str, others: Collection[str]) -> bool:
        """Whether a point does not look like what it is named beside some others."""
        found = [self._squares((name, other)) for other in others]
        return any(len(squares) >= _PULSES_LEAST and float(np.median(squares)) >= USUAL for squares in found)

    def _squares(self, pair: tuple[str, str], second: str | None = None) -> Floats:
        """Implausibility in each pulse that shows both."""
        one, other = map(POINTS.index, pair)
        difference = self._xyz[:, other] - self._xyz[:, one]
        difference = difference[np.isfinite(difference).all(axis=1)]
        return implausibility(one, other if second is None else POINTS.index(second), difference)


def _axes(xyz: Floats) -> Floats:
    """(3, 3) along the way of the points (t, 4, 3), horizontally, to its left, and up."""
    way = np.zeros(3)
    for of_point in xyz.swapaxes(0, 1):
        seen = of_point[np.isfinite(of_point).all(axis=1)]
        if len(seen):
            way += seen[-1] - seen[0]
    length = float(np.hypot(*way[:2]))
    x, y = way[:2] / length if length > 0 else (1.0, 0.0)
    return np.array(((x, y, 0.0), (-y, x, 0.0), (0.0, 0.0, 1.0)))
