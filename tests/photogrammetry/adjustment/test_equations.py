"""Observation equations, normal equations and covariance against dense ones and central differences."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from photogrammetry.adjustment.equations.problem import build_problem
from photogrammetry.adjustment.equations.unknowns import state_of
from photogrammetry.adjustment.solution.adjustment import adjust_once
from photogrammetry.adjustment.solution.datum import similarity_directions
from photogrammetry.adjustment.solution.normals import build_normals, factorise
from photogrammetry.network.model import Network
from tests.photogrammetry.dense import analytic_jacobian, dense_cofactors, flat_residuals, numeric_jacobian
from tests.photogrammetry.synthetic import hill, lab_frame, rods


def weighted_poses() -> Network:
    """The hill with weighted poses (D.2), one free point as a distance's end, and weighted camera parameters."""
    network = hill(3, helmets=3).network
    images = tuple(
        replace(image, sigma_position=np.full(3, 0.5), sigma_angles=np.full(3, 0.0016)) for image in network.images
    )
    camera = replace(network.cameras[0], estimate=("c", "a1"), sigma={"c": 5.0, "a1": 1e-8})
    return replace(network, images=images, cameras=(camera, *network.cameras[1:]))


CASES = {
    "lab": lambda: lab_frame(5, points=16).network,
    "hill": lambda: hill(1).network,
    "rods": lambda: rods(1).network,
    "weighted": weighted_poses,
}


@pytest.mark.parametrize("case", CASES.values(), ids=CASES.keys())
def test_jacobian_against_central_differences(case: Callable[[], Network]) -> None:
    network = case()
    problem, state = build_problem(network), state_of(network)
    analytic = analytic_jacobian(problem, problem.equations(state))
    length = np.linalg.norm(analytic, axis=0)
    numeric = numeric_jacobian(problem, state, 1.0 / length)
    # a step of 1e-2 of what changes the residuals by one leaves rounding of 1e-16 * 2e3 sigma / 1e-2 = 2e-11
    assert np.abs((numeric - analytic) / length).max() < 1e-8


@pytest.mark.parametrize("case", CASES.values(), ids=CASES.keys())
def test_step_is_that_of_the_dense_system(case: Callable[[], Network]) -> None:
    network = case()
    problem, state = build_problem(network), state_of(network)
    equations = problem.equations(state)
    jacobian, v = analytic_jacobian(problem, equations), flat_residuals(problem, state)
    normals = build_normals(problem, equations)
    damping = 1e-3  # makes the free network regular as well
    step = factorise(normals, np.zeros((len(normals.scale), 0)), damping).solve()
    scaled = jacobian * normals.scale
    dense = -normals.scale * np.linalg.solve(scaled.T @ scaled + damping * np.eye(len(step)), scaled.T @ v)
    assert np.abs((step - dense) / normals.scale).max() < 1e-7 * np.abs(dense / normals.scale).max()


@pytest.mark.parametrize("case", CASES.values(), ids=CASES.keys())
def test_covariance_and_redundancy_of_the_dense_system(case: Callable[[], Network]) -> None:
    adjustment = adjust_once(case())
    problem = adjustment.problem
    jacobian = analytic_jacobian(problem, adjustment.equations)
    moves = chosen = None
    if adjustment.free.defect:
        moves = similarity_directions(problem, adjustment.state, adjustment.free.centre) @ adjustment.free.directions
        chosen = np.zeros_like(moves)
        columns = problem.unknowns.point.ravel()
        chosen[columns] = moves[columns]
    dense = dense_cofactors(jacobian, moves, chosen)
    sigma = np.sqrt(np.diagonal(dense))
    assert np.abs((adjustment.cofactors - dense) / sigma[:, None] / sigma).max() < 1e-6
    r = 1.0 - np.einsum("ij,jk,ik->i", jacobian, dense, jacobian)
    ours = np.append(adjustment.controlled.image_numbers.ravel(), adjustment.controlled.relation)
    assert np.abs(ours - r).max() < 1e-7
    assert ours.sum() == pytest.approx(adjustment.redundancy, abs=1e-6)


@pytest.mark.parametrize("case", CASES.values(), ids=CASES.keys())
def test_the_optimum_has_no_gradient(case: Callable[[], Network]) -> None:
    adjustment = adjust_once(case())
    normals = build_normals(adjustment.problem, adjustment.equations)
    assert np.abs(normals.gradient).max() < 1e-5 * adjustment.ratio * np.sqrt(adjustment.problem.n_observations)
