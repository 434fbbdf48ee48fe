"""A comparison as lines for the terminal and as JSON; its page is in `analysis.report.compared`."""

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from analysis.comparison.aligned import MeasuredJump
from analysis.comparison.alignment import Alignment
from analysis.comparison.difference import LEVEL, Difference, Power
from analysis.comparison.scatter import Scatter
from analysis.comparison.shared_calibration import Common
from analysis.result.model import QUANTITIES
from rig.arrays import Floats

FORMAT: Final = "svev-comparison/1"
#: Instants of the tables, s since the take-off.
INSTANTS: Final = (-0.1, 0.0, 0.1, 0.2, 0.3, 0.5, 0.7)
#: In words, symbol, unit, decimals.
WORDS: Final = {
    "alpha": ("leg angle", "alpha", "°", 1),
    "beta": ("hip angle", "beta", "°", 1),
    "gamma": ("opening of the V", "gamma", "°", 1),
    "dphi": ("difference of the skis' slopes", "dphi", "°", 1),
    "phi": ("slope of the skis", "phi", "°", 1),
    "angle_of_attack": ("angle of attack", "attack", "°", 1),
    "height": ("height", "Z0", "m", 3),
    "speed": ("speed", "v", "m/s", 2),
    "velocity_x": ("velocity along X", "vX", "m/s", 2),
    "velocity_y": ("velocity along Y", "vY", "m/s", 2),
    "velocity_z": ("velocity along Z", "vZ", "m/s", 2),
}
_CALIBRATION: Final = {
    Common.CALIBRATION: "both jumps have the same calibration: its errors cancel",
    Common.SURVEY: "both recordings were oriented with the same survey: its errors cancel",
    Common.NOTHING: "the jumps have different calibrations: the errors of both count",
}


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """Two jumps and what was found.

    Attributes:
        alignment: of all jumps; the first two are compared.
        difference: B minus A.
        scatter: the athlete's own; None if not known.
    """

    alignment: Alignment
    difference: Difference
    scatter: Scatter | None

    @property
    def a(self) -> MeasuredJump:
        """The one jump."""
        return self.alignment.jumps[0]

    @property
    def b(self) -> MeasuredJump:
        """The other."""
        return self.alignment.jumps[1]


def summary(comparison: Comparison) -> list[str]:
    """Lines for the terminal: what differs, by how much, and what would have been found."""
    power = [(name, power) for name, power in comparison.difference.power.items() if power]
    return [
        *_verdict(comparison),
        "would have been found, if it lasted over the flight:",
        *(f"  {WORDS[name][0]}: {', '.join(_chances(name, each))}" for name, each in power),
    ]


def _verdict(comparison: Comparison) -> list[str]:
    d = comparison.difference
    found = d.found()
    lines = [f"A: {_title(comparison.a)}", f"B: {_title(comparison.b)}"]
    if found:
        lines.append(f"different at {100 * LEVEL:.0f} %, B minus A where it differs most:")
        lines += [f"  {_greatest(comparison, name)}" for name in found]
    else:
        lines.append(f"no difference found at {100 * LEVEL:.0f} %")
    lines.append(
        f"the greatest of {int(np.isfinite(d.value).sum())} differences is judged as the greatest of "
        f"{d.independent:.0f} independent ones: its limit is {d.limit:.1f} times the sigma of repeated measurements"
    )
    lines.append(_CALIBRATION[d.common])
    if not comparison.alignment.at_one_place:
        lines.append("the take-offs are not at one place, so each jump has its own: do both recordings show one hill?")
    if comparison.scatter is None:
        return [*lines, "the athlete's own scatter is not known: give further jumps of the athlete with --also"]
    return [*lines, f"the athlete's own scatter is that of {comparison.scatter.jumps} further jumps"]


def _title(jump: MeasuredJump) -> str:
    who = f", {jump.athlete}" if jump.athlete else ""
    return f"{jump.name}, jump {jump.jump.number}{who}"


def _greatest(comparison: Comparison, name: str) -> str:
    d, row = comparison.difference, QUANTITIES.index(name)
    at = d.greatest(row)
    words, _, unit, _ = WORDS[name]
    if at is None:
        return f"{words}: not known"
    return (
        f"{words}: {plus_minus(name, d.value[row, at], d.sigma[row, at])} {unit} at {signed(d.times[at], 2)} s "
        f"({in_words(d.p_greatest[row, at])}){_own(comparison, row, at)}"
    )


def _own(comparison: Comparison, row: int, at: int) -> str:
    d, scatter = comparison.difference, comparison.scatter
    if scatter is None or not np.isfinite(scatter.deviation[row, at]):
        return ""
    return f"; two of the athlete's own jumps differ as much with {in_words(float(scatter.p(d.value)[row, at]))}"


def _chances(name: str, power: Power) -> tuple[str, str]:
    """How likely the usual change is found, and which change is found in 80 %."""
    _, _, unit, decimals = WORDS[name]
    percent = f"{100 * power.probability:.0f} %" if power.probability < 0.995 else "more than 99 %"
    return f"{power.change:g} {unit} in {percent}", f"{power.change_80:.{decimals + 1}f} {unit} in 80 %"


def instants(times: Floats) -> list[int]:
    """Indices of the times nearest to `INSTANTS`, as far as they are within the times."""
    step = float(times[1] - times[0])
    nearest = [(int(np.argmin(np.abs(times - instant))), instant) for instant in INSTANTS]
    return [at for at, instant in nearest if abs(times[at] - instant) <= step]


def to_json(comparison: Comparison) -> dict[str, Any]:
    """The content of `comparison.json`; null where something is not known."""
    d, own = comparison.difference, comparison.scatter
    quantities = {}
    for row, name in enumerate(QUANTITIES):
        power = d.power[name]
        quantities[name] = {
            "unit": WORDS[name][2].replace("°", "deg"),
            "different": name in d.found(),
            "greatest": _greatest_json(d, row),
            "power": None
            if power is None
            else {"change": power.change, "probability": power.probability, "change_80": power.change_80},
            "a": _list(d.a[row]),
            "b": _list(d.b[row]),
            "difference": _list(d.value[row]),
            "sigma": _list(d.sigma[row]),
            "sigma_repeat": _list(d.repeat[row]),
            "p": _list(d.p[row]),
            "p_greatest": _list(d.p_greatest[row]),
            "scatter": None if own is None else _list(own.deviation[row]),
            "p_scatter": None if own is None else _list(own.p(d.value)[row]),
        }
    return {
        "format": FORMAT,
        **{
            key: {
                "name": jump.name,
                "recording": jump.recording.recording,
                "jump": jump.jump.number,
                "session": dict(jump.recording.session),
            }
            for key, jump in (("a", comparison.a), ("b", comparison.b))
        },
        "level": LEVEL,
        "same_calibration": d.common is Common.CALIBRATION,
        "same_survey": d.common is not Common.NOTHING,
        "takeoffs_at_one_place": comparison.alignment.at_one_place,
        "independent_differences": d.independent,
        "limit": d.limit,
        "different": d.found(),
        "scatter": None if own is None else {"jumps": own.jumps, "degrees_of_freedom": own.freedom},
        "since_takeoff_s": _list(d.times),
        "quantities": quantities,
    }


def _greatest_json(d: Difference, row: int) -> dict[str, float] | None:
    at = d.greatest(row)
    if at is None:
        return None
    return {
        "since_takeoff_s": float(d.times[at]),
        "difference": float(d.value[row, at]),
        "sigma": float(d.sigma[row, at]),
        "p": float(d.p_greatest[row, at]),
    }


def _list(values: Floats) -> list[float | None]:
    return [value if math.isfinite(value) else None for value in values.tolist()]


def plus_minus(name: str, value: float, sigma: float) -> str:
    """A difference of a quantity with its standard deviation."""
    return f"{signed(value, WORDS[name][3])} ± {deviation(name, sigma)}"


def deviation(name: str, sigma: float) -> str:
    """A standard deviation of a quantity; one that its digits cannot show is less than the last one."""
    decimals = WORDS[name][3]
    return f"{sigma:.{decimals}f}" if round(sigma, decimals) else f"< {10.0**-decimals:.{decimals}f}"


def signed(value: float, decimals: int) -> str:
    """A number with its sign."""
    rounded = round(value, decimals)
    return f"{rounded:+.{decimals}f}".replace("-", "\N{MINUS SIGN}") if rounded else f"{0:.{decimals}f}"


def plain(value: float, decimals: int) -> str:
    """A number; nothing if it is not known."""
    return f"{value:.{decimals}f}" if math.isfinite(value) else ""


def in_words(p: float) -> str:
    """A probability."""
    return "p < 0.0001" if p < 1e-4 else f"p = {p:.2g}"
