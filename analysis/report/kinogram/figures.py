"""The seven figures of a kinogram, each marked against the athlete's own ten best jumps before it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum
from typing import Final

import numpy as np
from scipy.special import stdtrit

from analysis.report.course import Course
from analysis.report.figures import EARLY_S, FAR_M, five_figures
from analysis.report.kinogram.earlier import EarlierJump
from analysis.result.model import Quantity

#: Of so many earlier jumps the figures are compared with.
BEST: Final = 10
#: Fewer tell no scatter.
FEWEST: Final = 3
#: Of so many jumps in which nothing is new, one gets a mark for any of its figures.
_FALSE_MARKS: Final = 1 / 20
#: Where more is better for the length of a jump; of the others nobody knows without the jumper.
MORE_IS_BETTER: Final = frozenset({"takeoff_speed", "perpendicular"})
_RANKED_BY: Final = "takeoff_speed"
UNITS: Final[Mapping[str, str]] = {
    "takeoff_speed": "m/s",
    "perpendicular": "m/s",
    "speed_20_m": "m/s",
    "angle_of_attack": "°",
    "ski_to_body": "°",
    "v_angle": "°",
    "height_20_m": "m",
}


class Word(StrEnum):
    """What a difference from the earlier jumps is."""

    BETTER = "better"
    WORSE = "worse"
    HIGHER = "higher"
    LOWER = "lower"
    NOISE = "within noise"


@dataclass(frozen=True, slots=True)
class Mark:
    """A figure beside those of earlier jumps.

    Attributes:
        word: what the difference is.
        difference: this jump minus their mean.
        mean: of theirs.
        jumps: how many they are.
    """

    word: Word
    difference: float
    mean: float
    jumps: int


@dataclass(frozen=True, slots=True)
class Reference:
    """The earlier jumps that a jump is compared with.

    Attributes:
        jumps: at most `BEST`.
        by_speed: they are the fastest at the take-off; else the latest, since no take-off speed is known.
    """

    jumps: tuple[EarlierJump, ...]
    by_speed: bool


def figures_of(course: Course, perpendicular: Quantity | None) -> dict[str, Quantity | None]:
    """The figures by the names of `UNITS`; None where not measured. The first five are those of the coach's page.

    Args:
        course: of the jump.
        perpendicular: velocity perpendicular to the table at the take-off, m/s.
    """
    five = [figure.quantity for figure in five_figures(course, perpendicular)]
    more = [course.at_time("gamma", EARLY_S), course.at_distance("height", FAR_M)]
    return dict(zip(UNITS, [*five, *more], strict=True))


def reference_of(earlier: Sequence[EarlierJump], before: datetime) -> Reference:
    """The jumps that a jump is compared with: of those before it that can be trusted the fastest, else the latest.

    Args:
        earlier: jumps of the same athlete.
        before: time of the jump.
    """
    trusted = [jump for jump in earlier if jump.ok and jump.time < before]
    ranked = [jump for jump in trusted if _RANKED_BY in jump.figures]
    if ranked:
        ranked.sort(key=lambda jump: jump.figures[_RANKED_BY].value, reverse=True)
        return Reference(tuple(ranked[:BEST]), by_speed=True)
    trusted.sort(key=lambda jump: jump.time, reverse=True)
    return Reference(tuple(trusted[:BEST]), by_speed=False)


def marks_of(figures: Mapping[str, Quantity | None], reference: Reference) -> dict[str, Mark]:
    """A mark for each figure that this jump and three or more of the others have.

    A difference d from their mean is noise if |d| <= t sqrt(sigma^2 + s^2 (1 + 1/n)): sigma of this jump's figure, s
    the scatter of the others, n how many they are, t the quantile of Student's distribution with n - 1 degrees of
    freedom at which all figures together give one of `_FALSE_MARKS` jumps a mark by chance (Bonferroni). s has the
    errors of measurement of the others in it.
    """
    pairs = {}
    for name, own in figures.items():
        theirs = np.array([jump.figures[name].value for jump in reference.jumps if name in jump.figures])
        if own is not None and len(theirs) >= FEWEST:
            pairs[name] = own, theirs
    return {name: _mark(name, own, theirs, _FALSE_MARKS / len(pairs)) for name, (own, theirs) in pairs.items()}


def _mark(name: str, own: Quantity, theirs: np.ndarray, chance: float) -> Mark:
    n = len(theirs)
    mean, scatter = float(theirs.mean()), float(theirs.std(ddof=1))
    difference = own.value - mean
    bound = float(stdtrit(n - 1, 1 - chance / 2)) * float(np.hypot(own.sigma, scatter * np.sqrt(1 + 1 / n)))
    if abs(difference) <= bound:
        word = Word.NOISE
    elif name in MORE_IS_BETTER:
        word = Word.BETTER if difference > 0 else Word.WORSE
    else:
        word = Word.HIGHER if difference > 0 else Word.LOWER
    return Mark(word, difference, mean, n)
