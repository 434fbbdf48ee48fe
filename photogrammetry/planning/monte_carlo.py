"""Predicts sigmas by Monte Carlo: repeats steps 2 and 3 with new random errors (Hastedt 2004).

All samples of a chunk iterate together, with exact derivatives; each ends at its own least-squares solution.
"""

import copy
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

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
from rig.each import Each

#: The relative sigma of a simulated sigma is 1 / sqrt(2 samples): 1.1 %. The worst of some hundred figures is off by
#: 3.5 times that, less than the 5 % within which the two predictions must agree.
SAMPLES = 4000
#: At most so many parts of a simulation, each of which may run elsewhere.
_TASKS: Final = 64


def simulate(
    plan: Plan,
    adjusted: Adjustment,
    *,
    samples: int,
    seed: int,
    done: Callable[[int], None] = lambda _: None,
    each: Each = map,
) -> Sigmas:
    """Standard deviations about the true values, from repeated steps 2 and 3.

    Args:
        plan: the planned network.
        adjusted: its step 2 without errors.
        samples: number of repetitions.
        seed: of the random numbers.
        done: progress callback, called with the number of samples done so far; does nothing by default.
        each: applies a function to all of its arguments, in order; another one than `map` may do so elsewhere, and the
            figures stay the same to the last bit.

    Raises:
        NotConvergedError: the errors are so large that a sample does not converge.
    """
    repeated = _Repeated(plan, adjusted)
    chunks = repeated.chunks(samples, seed)
    together = -(-len(chunks) // _TASKS)
    tasks = [chunks[first : first + together] for first in range(0, len(chunks), together)]
    squares: list[tuple[Floats, ...]] = []
    counted = 0
    for task, found in zip(tasks, each(repeated.squares, tasks), strict=True):
        squares += found
        counted += sum(chunk.count for chunk in task)
        done(counted)
    sigmas = [np.sqrt(np.sum(part, axis=0) / samples) for part in zip(*squares, strict=True)]
    return Sigmas(*sigmas) if plan.flight is not None else Sigmas(sigmas[0], sigmas[1], *no_flight())


@dataclass(frozen=True, slots=True, eq=False)
class _Chunk:
    """Samples that iterate together.

    Attributes:
        count: how many.
        rng: draws their errors.
    """

    count: int
    rng: np.random.Generator


class _Repeated:
    """Steps 2 and 3 of a plan, prepared for repetition."""

    def __init__(self, plan: Plan, adjusted: Adjustment) -> None:
        self._truth, self._step_two = adjusted.state, StepTwo(adjusted)
        self._selection = adjusted.problem.unknowns.selection
        self._flight = None if plan.flight is None else _RepeatedFlight(plan, plan.flight, adjusted.state)

    def chunks(self, samples: int, seed: int) -> list[_Chunk]:
        """All samples, each chunk with the generator as the one before leaves it."""
        rng, size = np.random.default_rng(seed), self._step_two.chunk
        found = []
        for first in range(0, samples, size):
            found.append(_Chunk(min(size, samples - first), copy.deepcopy(rng)))
            self._step_two.drawn(found[-1].count, rng)
            if self._flight is not None:
                self._flight.drawn(found[-1].count, rng)
        return found

    def squares(self, chunks: Sequence[_Chunk]) -> list[tuple[Floats, ...]]:
        """Of each chunk the sums of the squared errors, in the order of `Sigmas`."""
        return [self._squares(chunk) for chunk in chunks]

    def _squares(self, chunk: _Chunk) -> tuple[Floats, ...]:
        truth, states = self._truth, self._step_two.repeated(chunk.count, chunk.rng)
        errors = [states.position - truth.position, (states.interior - truth.interior)[:, :, self._selection]]
        errors += [] if self._flight is None else self._flight.errors(states, chunk.rng)
        return tuple(np.sum(error**2, axis=0) for error in errors)


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
        of_points, of_skis = self.drawn(n, rng)
        noisy = replace(sights, points=sights.points + of_points, skis=sights.skis + of_skis)
        flat_points, flat_angles = intersect_samples(self.network, states, noisy, self.truth)
        points, angles = flat_points.reshape(n, *flight.points.shape), flat_angles.reshape(n, *flight.skis.shape[:2], 2)
        tied = flight.tie >= 0
        points[:, tied] = states.xyz[:, flight.tie[tied]]
        stick = [found - true for found, true in zip(self._stick(points, angles), self.true_stick, strict=True)]
        return [points - flight.points, angles - self.truth.angles.reshape(angles.shape[1:]), *stick]

    def drawn(self, count: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
        """Errors of the image points and lines of so many samples."""
        sights = self.sights
        of_points = rng.normal(0.0, sights.sigma, (count, *sights.points.shape))
        return of_points, rng.normal(0.0, sights.sigma, (count, *sights.skis.shape))

    def _stick(self, points: Floats, angles: Floats) -> tuple[Floats, Floats]:
        """Values of the stick model (..., t, 6) and speeds (..., t - 1)."""
        stick = self.flight.stick
        if stick is None:
            return np.zeros((*points.shape[:-2], 0)), np.zeros((*points.shape[:-3], 0))
        origins = points[..., stick.bindings, :].mean(axis=-2)
        return stick_values(self.flight, stick, features(points, angles)), speeds(stick, origins)
