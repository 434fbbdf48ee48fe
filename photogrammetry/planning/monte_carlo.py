"""Predicts sigmas by Monte Carlo: repeats steps 2 and 3 with new random errors (Hastedt 2004).

All samples of a chunk iterate together, with exact derivatives; each ends at its own least-squares solution.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from photogrammetry.adjustment.equations.unknowns import State
from photogrammetry.adjustment.solution.adjustment import Adjustment
from photogrammetry.planning.plan import Flight, Plan
from photogrammetry.planning.prediction import Sigmas, no_flight
from photogrammetry.planning.step_three import (
    error_free_sights,
    features,
    intersect_flight,
    intersect_samples,
    speeds,
    stick_values,
)
from photogrammetry.planning.step_two_samples import StepTwo
from rig.arrays import Floats

#: The relative sigma of a simulated sigma is 1 / sqrt(2 samples): 1.1 %. The worst of some hundred figures is off by
#: 3.5 times that, less than the 5 % within which the two predictions must agree.
SAMPLES = 4000


def simulate(
    plan: Plan, adjusted: Adjustment, *, samples: int, seed: int, done: Callable[[int], None] = lambda _: None
) -> Sigmas:
    """Standard deviations about the true values, from repeated steps 2 and 3.

    Args:
        plan: the planned network.
        adjusted: its step 2 without errors.
        samples: number of repetitions.
        seed: of the random numbers.
        done: progress callback, called with the number of samples done so far; does nothing by default.

    Raises:
        NotConvergedError: the errors are so large that a sample does not converge.
    """
    rng, truth, step_two = np.random.default_rng(seed), adjusted.state, StepTwo(adjusted)
    selection = adjusted.problem.unknowns.selection
    repeated = None if plan.flight is None else _RepeatedFlight(plan, plan.flight, truth)
    squares: list[tuple[Floats, ...]] = []
    for first in range(0, samples, step_two.chunk):
        states = step_two.repeated(min(step_two.chunk, samples - first), rng)
        errors = [states.position - truth.position, (states.interior - truth.interior)[:, :, selection]]
        errors += [] if repeated is None else repeated.errors(states, rng)
        squares.append(tuple(np.sum(error**2, axis=0) for error in errors))
        done(min(first + step_two.chunk, samples))
    sigmas = [np.sqrt(np.sum(part, axis=0) / samples) for part in zip(*squares, strict=True)]
    return Sigmas(*sigmas) if repeated is not None else Sigmas(sigmas[0], sigmas[1], *no_flight())


class _RepeatedFlight:
    """Step 3 of a plan, prepared for repetition."""

    def __init__(self, plan: Plan, flight: Flight, truth: State) -> None:
        self.network, self.flight = plan.network, flight
        self.sights = error_free_sights(plan, flight)
        self.truth = intersect_flight(plan.network, truth, self.sights)
        self.true_stick = self._stick(flight.points, self.truth.angles.reshape(*flight.skis.shape[:2], 2))

    def errors(self, states: State, rng: np.random.Generator) -> list[Floats]:
        """Errors in the order of `Sigmas`; for jumper points that are tie points, those of step 2."""
        flight, sights, n = self.flight, self.sights, len(states.xyz)
        noisy = replace(
            sights,
            points=sights.points + rng.normal(0.0, sights.sigma, (n, *sights.points.shape)),
            skis=sights.skis + rng.normal(0.0, sights.sigma, (n, *sights.skis.shape)),
        )
        flat_points, flat_angles = intersect_samples(self.network, states, noisy, self.truth)
        points, angles = flat_points.reshape(n, *flight.points.shape), flat_angles.reshape(n, *flight.skis.shape[:2], 2)
        tied = flight.tie >= 0
        points[:, tied] = states.xyz[:, flight.tie[tied]]
        stick = [found - true for found, true in zip(self._stick(points, angles), self.true_stick, strict=True)]
        return [points - flight.points, angles - self.truth.angles.reshape(angles.shape[1:]), *stick]

    def _stick(self, points: Floats, angles: Floats) -> tuple[Floats, Floats]:
        """Values of the stick model (..., t, 6) and speeds (..., t - 1)."""
        stick = self.flight.stick
        if stick is None:
            return np.zeros((*points.shape[:-2], 0)), np.zeros((*points.shape[:-3], 0))
        origins = points[..., stick.bindings, :].mean(axis=-2)
        return stick_values(self.flight, stick, features(points, angles)), speeds(stick, origins)
