"""Benchmark of the planner's Monte Carlo against scipy's least_squares on the same step 2, sample by sample."""

import time
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from photogrammetry.adjustment.equations.problem import Problem
from photogrammetry.adjustment.equations.unknowns import State
from photogrammetry.adjustment.solution.adjustment import Adjustment
from photogrammetry.planning.description import read_description
from photogrammetry.planning.monte_carlo import simulate
from photogrammetry.planning.plan import plan_from
from photogrammetry.planning.prediction import adjusted_plan
from rig.arrays import Floats
from rig.settings.file import CONFIG

_SAMPLES = 1000
_SCIPY_SAMPLES = 10  # enough to measure scipy's time per sample


def run_planning(seconds: float) -> list[dict[str, Any]]:
    """1000 samples of steps 2 and 3 on the hill, helmet as tie point.

    Args:
        seconds: about how long in all.

    Returns:
        One case with name, value, unit, baseline and what the baseline is.
    """
    plan = plan_from(read_description(CONFIG / "networks" / "hill-2.toml"))
    adjusted = adjusted_plan(plan)
    ours: list[float] = []
    theirs: list[float] = []
    end = time.perf_counter() + seconds
    while time.perf_counter() < end or not ours:
        # alternating, so that other load on the machine affects both
        begin = time.perf_counter()
        simulate(plan, adjusted, samples=_SAMPLES, seed=len(ours))
        ours.append(time.perf_counter() - begin)
        theirs.append(_scipy(adjusted, len(theirs)) * _SAMPLES / _SCIPY_SAMPLES)
    return [
        {
            "name": "1000 samples of steps 2 and 3",
            "unit": "s",
            "value": round(float(np.median(ours)), 3),
            "baseline": round(float(np.median(theirs)), 3),
            "baseline_is": f"scipy least_squares (lm, analytic Jacobian), step 2 alone, from {_SCIPY_SAMPLES} samples",
        }
    ]


def _scipy(adjusted: Adjustment, seed: int) -> float:
    """Seconds for the step 2 of some samples."""
    rng, exact = np.random.default_rng(seed), adjusted.problem
    sigma = np.sqrt(np.diagonal(adjusted.cofactors))
    begin = time.perf_counter()
    for _ in range(_SCIPY_SAMPLES):
        problem = replace(exact, xy=exact.xy + exact.sigma * rng.standard_normal(exact.xy.shape))
        errors = rng.standard_normal(len(exact.relations))

        def residuals(x: Floats, problem: Problem = problem, errors: Floats = errors) -> Floats:
            equations = problem.equations(problem.unknowns.moved(adjusted.state, x * sigma))
            return np.concatenate([equations.v.ravel(), equations.relations.v - errors])

        def jacobian(x: Floats, problem: Problem = problem) -> Floats:
            return _jacobian(problem, problem.unknowns.moved(adjusted.state, x * sigma)) * sigma

        least_squares(residuals, np.zeros(exact.unknowns.count), jac=jacobian, method="lm", xtol=1e-6, ftol=1e-6)
    return time.perf_counter() - begin


def _jacobian(problem: Problem, state: State) -> Floats:
    """All derivatives as a dense matrix; rotations taken as increments, exact to second order near the start."""
    equations, n = problem.equations(state), len(problem.image)
    columns = np.hstack([problem.global_columns()[problem.image], problem.unknowns.point[problem.point]])
    matrix = np.zeros((problem.n_observations, problem.unknowns.count + 1))  # the last column is that of constants
    rows = np.arange(2 * n).reshape(n, 2, 1)
    matrix[rows, columns[:, None, :]] = np.concatenate([equations.by_global, equations.by_point], axis=2)
    relations = equations.relations
    matrix[2 * n + np.arange(len(relations.v))[:, None], relations.columns] = relations.values
    return matrix[:, :-1]
