"""Sets measured jumps beside their truth: share that is solved, errors, and whether the sigmas tell of them."""

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from analysis.measurements.model import POINTS
from analysis.result.model import Jump, JumperState, PulseState, SmoothedState
from rig.arrays import Floats

#: The paper's requirement, m.
REQUIRED_M = 0.02
_RAYS = 2


@dataclass(slots=True)
class Judged:
    """What was found out about one or several jumps.

    Attributes:
        in_sight: points that at least two cameras see, over all pulses.
        solved: how many of them are measured.
        errors_m: largest coordinate error of each measured point.
        errors: by part ("raw" or "smoothed"), phase and quantity: errors beside their sigmas.
        takeoff: errors of the take-off over their sigmas.
    """

    in_sight: int = 0
    solved: int = 0
    errors_m: list[float] = field(default_factory=list)
    errors: dict[tuple[str, str, str], list[tuple[float, float]]] = field(default_factory=lambda: defaultdict(list))
    takeoff: list[float] = field(default_factory=list)

    def jump(self, jump: Jump, truth: Mapping[int, Mapping[str, Any]]) -> None:
        """Judge a jump by the truth of its pulses."""
        for pulse in jump.pulses:
            true = truth.get(pulse.pulse)
            if true is not None and true.get("points"):
                self._pulse(pulse, true)
        first = next((true for true in truth.values() if true.get("points")), None)
        if jump.takeoff is not None and first is not None:
            number = next(number for number, true in truth.items() if true is first)
            edge = number + float(first["takeoff_pulse"]) - float(first["pulse"])
            self.takeoff.append((jump.takeoff.pulse - edge) / jump.takeoff.sigma_pulses)

    def add(self, other: "Judged") -> None:
        """Count further jumps, behind those that are counted already."""
        self.in_sight += other.in_sight
        self.solved += other.solved
        self.errors_m += other.errors_m
        self.takeoff += other.takeoff
        for key, pairs in other.errors.items():
            self.errors[key] += pairs

    def figures(self) -> dict[str, Any]:
        """Shares, errors, and per part, phase and quantity whether the sigmas hold."""
        honesty = {" ".join(key): _honesty(np.array(pairs)) for key, pairs in sorted(self.errors.items())}
        errors = np.array(self.errors_m)
        return {
            "points_in_sight": self.in_sight,
            "solved": self.solved / max(1, self.in_sight),
            "within_0.02_m": float(np.mean(errors < REQUIRED_M)) if len(errors) else None,
            "error_95_percent_m": float(np.quantile(errors, 0.95)) if len(errors) else None,
            "takeoff_mean_square": _mean_square(self.takeoff),
            "honesty": honesty,
        }

    def _pulse(self, pulse: PulseState, true: Mapping[str, Any]) -> None:
        for name in POINTS:
            if sum(bool(sight[name]) for sight in true["in_sight"].values()) < _RAYS:
                continue
            self.in_sight += 1
            point = pulse.raw.points[name]
            if point is not None:
                self.solved += 1
                self.errors_m.append(float(np.abs(point.xyz - np.array(true["points"][name])).max()))
        self._state("raw", pulse.phase.value, pulse.raw, true)
        if pulse.smoothed is not None:
            self._state("smoothed", pulse.phase.value, pulse.smoothed, true)

    def _state(self, part: str, phase: str, state: JumperState | SmoothedState, true: Mapping[str, Any]) -> None:
        for name, point in state.points.items():
            if point is not None:
                error = point.xyz - np.array(true["points"][name])
                self._add(part, phase, "points", error, np.sqrt(np.diagonal(point.covariance)))
        quantities = {**state.angles, "height": state.height, "speed": state.speed}
        for name, quantity in quantities.items():
            if quantity is not None:
                value = true["angles"].get(name, true.get(name))
                self._add(part, phase, name, np.array([quantity.value - float(value)]), np.array([quantity.sigma]))

    def _add(self, part: str, phase: str, quantity: str, errors: Floats, sigmas: Floats) -> None:
        self.errors[part, phase, quantity] += zip(errors.tolist(), sigmas.tolist(), strict=True)


def _honesty(pairs: Floats) -> dict[str, Any]:
    """Of errors beside their sigmas (n, 2): mean squared normalized error, share within 2 sigma, sigma / scatter."""
    error, sigma = pairs.T
    z = error / sigma
    return {
        "n": len(z),
        "mean_square": _mean_square(z),
        "within_2_sigma": round(float(np.mean(np.abs(z) < 2.0)), 3),
        "sigma_over_scatter": round(float(np.sqrt(np.mean(sigma**2) / np.mean(error**2))), 3),
    }


def _mean_square(z: Iterable[float]) -> float | None:
    values = np.array(list(z))
    return round(float(np.mean(values**2)), 3) if len(values) else None
