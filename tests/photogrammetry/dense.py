"""The adjustment with dense matrices, without blocks, elimination and scaling: reference for the fast one."""

import numpy as np

from photogrammetry.adjustment.equations.problem import Equations, Problem
from photogrammetry.adjustment.equations.relations import relation_residuals
from photogrammetry.adjustment.equations.unknowns import State
from photogrammetry.geometry.camera_model import residuals
from rig.arrays import Floats


def flat_residuals(problem: Problem, state: State) -> Floats:
    """All residuals in units of their sigmas: image points (x, y, x, y, ...), then relations."""
    pose = state.rotation[problem.image], state.position[problem.image]
    v = residuals(problem.lens(state), *pose, state.xyz[problem.point], problem.xy) / problem.sigma
    w = relation_residuals(problem.relations, state) / problem.relation_sigma
    return np.concatenate([v.ravel(), w])


def analytic_jacobian(problem: Problem, equations: Equations) -> Floats:
    """The blocks put together: (rows, unknowns)."""
    n = len(problem.image)
    jacobian = np.zeros((2 * n + len(problem.relations), problem.unknowns.count + 1))
    columns = problem.global_columns()
    for i in range(n):
        rows = slice(2 * i, 2 * i + 2)
        jacobian[rows, columns[problem.image[i]]] += equations.by_global[i]
        jacobian[rows, problem.unknowns.point[problem.point[i]]] += equations.by_point[i]
    relations = equations.relations
    for i in range(len(problem.relations)):
        np.add.at(jacobian[2 * n + i], relations.columns[i], relations.values[i])
    return jacobian[:, :-1]


def numeric_jacobian(problem: Problem, state: State, scale: Floats) -> Floats:
    """Central differences, steps of 1e-2 of `scale` (u,)."""
    columns = []
    for i, size in enumerate(scale):
        step = np.zeros(problem.unknowns.count)
        step[i] = 1e-2 * size
        ahead = flat_residuals(problem, problem.unknowns.moved(state, step))
        behind = flat_residuals(problem, problem.unknowns.moved(state, -step))
        columns.append((ahead - behind) / (2.0 * step[i]))
    return np.array(columns).T


def dense_cofactors(jacobian: Floats, moves: Floats | None = None, chosen: Floats | None = None) -> Floats:
    """(J^T J)^-1, or with inner constraints G^T dx = 0 (G = `chosen`, null space `moves`) by the bordered system."""
    scale = 1.0 / np.linalg.norm(jacobian, axis=0)
    normal = (jacobian * scale).T @ (jacobian * scale)
    if moves is None or chosen is None:
        return np.asarray(np.linalg.inv(normal) * scale[:, None] * scale)
    border = chosen * scale[:, None]
    size = len(normal)
    full = np.block([[normal, border], [border.T, np.zeros((border.shape[1],) * 2)]])
    return np.asarray(np.linalg.inv(full)[:size, :size] * scale[:, None] * scale)
