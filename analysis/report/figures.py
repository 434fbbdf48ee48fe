"""Numbers for people: the five that a coach wants first, and as many digits as a standard deviation allows."""

import math
from dataclasses import dataclass

from analysis.report.course import Course
from analysis.result.model import Quantity

#: Where they are taken: distance from the take-off, m, and time after it, s.
FAR_M = 20.0
EARLY_S = 0.5
#: A minus that is as wide as a plus.
_MINUS = "\N{MINUS SIGN}"
_MISSING = "\N{EN DASH}"
#: The most decimals that are ever shown: smaller sigmas are those of exact numbers.
_MOST_DECIMALS = 6
_MOST_OF_ANGLES = 1


def decimals(sigma: float) -> int:
    """Decimals of a value with this standard deviation: its sigma has one digit, two if the first is a one.

    0 for a sigma of 2 or more; a sigma that is not positive and finite gives 1.
    """
    if not (math.isfinite(sigma) and sigma > 0):
        return 1
    power = math.floor(math.log10(sigma))
    leading = round(sigma / 10.0**power, 1)
    if leading >= 10:
        power, leading = power + 1, leading / 10
    return min(max(0, -power + (leading < 2)), _MOST_DECIMALS)


def fixed(value: float, places: int) -> str:
    """A value with so many decimals; a dash if it is not finite."""
    if not math.isfinite(value):
        return _MISSING
    text = f"{value:.{places}f}"
    return text.replace("-", _MINUS) if float(text) else text.lstrip("-")


def value_and_sigma(quantity: Quantity, unit: str = "") -> tuple[str, str]:
    """Both numbers with the digits that sigma allows; an angle with one decimal at most, as coaches say it."""
    places = decimals(quantity.sigma)
    return fixed(quantity.value, min(places, _MOST_OF_ANGLES) if unit == "°" else places), fixed(quantity.sigma, places)


def plus_minus(quantity: Quantity | None, unit: str = "") -> str:
    """`26.12 ± 0.13 m/s`; a dash if there is no number. The degree sign follows without a space."""
    if quantity is None:
        return _MISSING
    value, sigma = value_and_sigma(quantity, unit)
    if unit == "°":
        return f"{value}° ± {sigma}°"
    return f"{value} ± {sigma} {unit}".strip()


@dataclass(frozen=True, slots=True)
class Figure:
    """One number.

    Attributes:
        title: what it is, in English.
        quantity: the number; None where it is not known.
        unit: of it.
        note: where the definition matters, in English.
        title_nb, note_nb: both in Norwegian.
    """

    title: str
    quantity: Quantity | None
    unit: str
    note: str
    title_nb: str
    note_nb: str


def five_figures(course: Course, perpendicular: Quantity | None) -> tuple[Figure, ...]:
    """The five numbers, some of them without a value if the course does not reach that far.

    Args:
        course: of the jump.
        perpendicular: velocity perpendicular to the table, m/s.
    """
    early = f"{EARLY_S:g} s after take-off"
    early_nb = f"{EARLY_S:g} s etter satsen".replace(".", ",")
    return (
        Figure(
            "Take-off speed",
            course.at_time("speed", 0.0),
            "m/s",
            "when the bindings pass the edge",
            "Fart på kanten",
            "når bindingene passerer hoppkanten",
        ),
        Figure(
            "Velocity perpendicular to the table",
            perpendicular,
            "m/s",
            "what the take-off adds, across the path before it; up is positive",
            "Fart vinkelrett på bordet",
            "det satsen gir, på tvers av banen før det; opp er positivt",
        ),
        Figure(
            f"Speed at {FAR_M:g}\N{NO-BREAK SPACE}m",
            course.at_distance("speed", FAR_M),
            "m/s",
            "horizontal distance from take-off",
            f"Fart ved {FAR_M:g}\N{NO-BREAK SPACE}m",
            "vannrett avstand fra satsen",
        ),
        Figure(
            "Angle of attack",
            course.at_time("angle_of_attack", EARLY_S),
            "°",
            f"{early}; skis against the path, no wind assumed",
            "Angrepsvinkel",
            f"{early_nb}; skiene mot banen, uten vind",
        ),
        Figure(
            "Ski-to-body angle",
            course.at_time("alpha", EARLY_S),
            "°",
            f"{early}; alpha, skis to legs",
            "Ski mot kropp",
            f"{early_nb}; alfa, ski mot legger",
        ),
    )
