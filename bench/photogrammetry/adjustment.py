"""Benchmark of the bundle adjustment against scipy's least_squares on the same problem from the same start values."""

import time
from typing import Any

import numpy as np
from scipy import sparse
from scipy.optimize import least_squares

from bench.photogrammetry.free_networks import free_network
from photogrammetry.adjustment.equations.problem import Problem, build_problem
from photogrammetry.adjustment.equations.unknowns import State, state_of
from photogrammetry.adjustment.solution.adjustment import Adjustment, adjust_once
from photogrammetry.adjustment.solution.datum import find_free_datum, similarity_directions
from photogrammetry.adjustment.solution.normals import build_normals, factorise
from photogrammetry.network.model import Network
from rig.arrays import Floats

#: scipy's sparse solver converges slowly on free networks; it is stopped after so many evaluations.
_EVALUATIONS = 60


def run_adjustment(seconds: float) -> list[dict[str, Any]]:
    """Free networks of 9 images x 60 points and 115 x 150, with full covariance and all redundancy numbers.

    Args:
        seconds: about how long to repeat the small one.

    Returns:
        Cases with name, value, unit, baseline and what the baseline is.
    """
    small = free_network(9, 60, cameras=3, estimate=("c", "x0", "y0", "a1"))
    large = free_network(115, 150, cameras=1, estimate=("c", "x0", "y0", "a1", "a2", "b1", "b2"))
    return [*_small_case(small, seconds / 4), *_large_cases(large)]


def _small_case(network: Network, budget: float) -> list[dict[str, Any]]:
    ours: list[float] = []
    theirs: list[float] = []
    end = time.perf_counter() + budget
    while time.perf_counter() < end or len(ours) < 3:
        # alternating, so that other load on the machine affects both
        adjusted, spent = _ours(network)
        ours.append(spent)
        cost, spent, _ = _scipy(network, dense=True)
        theirs.append(spent)
    agree = f"same vTPv to {abs(cost / adjusted.equations.square_sum - 1.0):.0e}"
    return [
        _case(
            "9 x 60, whole adjustment with covariance",
            "ms",
            1e3 * float(np.median(ours)),
            1e3 * float(np.median(theirs)),
            f"scipy least_squares (trf, dense, analytic Jacobian), no covariance; {agree}",
        )
    ]


def _large_cases(network: Network) -> list[dict[str, Any]]:
    _ours(network)
    adjusted, spent = _ours(network)
    cost, theirs, evaluations = _scipy(network, dense=False)
    off = cost / adjusted.equations.square_sum - 1.0
    what = f"scipy least_squares (trf, sparse, lsmr, analytic Jacobian), {evaluations} evaluations"
    return [
        _case(
            "115 x 150, whole adjustment with covariance",
            "s",
            spent,
            theirs,
            f"{what}, no covariance; vTPv then {off:.0e} above the optimum",
        ),
        _case("115 x 150, one iteration", "s", _iteration(network), theirs / evaluations, f"{what}, one evaluation"),
    ]


def _case(name: str, unit: str, value: float, baseline: float, what: str) -> dict[str, Any]:
    return {"name": name, "unit": unit, "value": round(value, 4), "baseline": round(baseline, 4), "baseline_is": what}


def _ours(network: Network) -> tuple[Adjustment, float]:
    """An adjustment and its seconds."""
    begin = time.perf_counter()
    adjusted = adjust_once(network)
    return adjusted, time.perf_counter() - begin


def _iteration(network: Network) -> float:
    """Seconds of one iteration: linearise, normal equations, datum, solution, new residuals."""
    problem, state = build_problem(network), state_of(network)
    spent = []
    for _ in range(5):
        begin = time.perf_counter()
        normals = build_normals(problem, problem.equations(state))
        free = find_free_datum(problem, normals, state)
        moves = similarity_directions(problem, state, free.centre) @ free.directions
        step = factorise(normals, moves / normals.scale[:, None]).solve()
        problem.square_sum(problem.unknowns.moved(state, step))
        spent.append(time.perf_counter() - begin)
    return float(np.median(spent))


def _scipy(network: Network, *, dense: bool) -> tuple[float, float, int]:
    """Square sum, seconds and evaluations of scipy's solution; its unknowns are increments from the start."""
    problem, start = build_problem(network), state_of(network)
    scale = _column_scale(problem, start)

    def residuals(x: Floats) -> Floats:
        equations = problem.equations(problem.unknowns.moved(start, x * scale))
        return np.asarray(equations.v.ravel(), dtype=float)

    def jacobian(x: Floats) -> Any:
        # near the start rotation increments may be added: the derivative is exact to second order in them
        matrix = _jacobian(problem, problem.unknowns.moved(start, x * scale)) @ sparse.diags_array(scale)
        return matrix.toarray() if dense else matrix.tocsr()

    options: dict[str, Any] = (
        {"tr_solver": "exact", "xtol": 1e-12, "ftol": 1e-12, "gtol": 1e-12}
        if dense
        else {"tr_solver": "lsmr", "max_nfev": _EVALUATIONS, "xtol": 1e-12, "ftol": 1e-12, "gtol": 1e-12}
    )
    begin = time.perf_counter()
    found = least_squares(residuals, np.zeros(problem.unknowns.count), jac=jacobian, method="trf", **options)
    return 2.0 * float(found.cost), time.perf_counter() - begin, int(found.nfev)


def _jacobian(problem: Problem, state: State) -> sparse.csr_array:
    """All derivatives as a sparse matrix (2n, u)."""
    equations, columns = problem.equations(state), problem.global_columns()[problem.image]
    n, u = len(problem.image), problem.unknowns.count
    places = np.hstack([columns, problem.unknowns.point[problem.point]])
    values = np.concatenate([equations.by_global, equations.by_point], axis=2)
    rows = np.broadcast_to(np.arange(2 * n).reshape(n, 2, 1), values.shape)
    where = np.broadcast_to(places[:, None, :], values.shape)
    return sparse.csr_array((values.ravel(), (rows.ravel(), where.ravel())), shape=(2 * n, u))


def _column_scale(problem: Problem, state: State) -> Floats:
    """Units in which all columns of the Jacobian have length one."""
    squares = _jacobian(problem, state).power(2).sum(axis=0)
    return np.asarray(1.0 / np.sqrt(np.asarray(squares)), dtype=float)
