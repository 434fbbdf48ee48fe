"""A network whose observations weigh alike: what they determine does not depend on their weights, but rounding does."""

from dataclasses import replace

import numpy as np

from photogrammetry.adjustment.equations.problem import Problem
from photogrammetry.adjustment.equations.unknowns import NONE, State
from photogrammetry.adjustment.solution.normals import build_normals


def levelled(problem: Problem, state: State) -> Problem:
    """The problem with weights of one order of magnitude, for the analysis of its rank alone.

    Every image point has the median sigma. A relation gets its sigma from the unknown that it determines best: it
    weighs as much there as the image points do.

    Args:
        problem: the network made ready.
        state: where to linearise.
    """
    median = float(np.median(problem.sigma)) if problem.sigma.size else 1.0
    alike = replace(problem, sigma=np.full_like(problem.sigma, median))
    weightless = replace(alike, relation_sigma=np.full_like(problem.relation_sigma, np.inf))
    size = np.append(build_normals(weightless, weightless.equations(state)).scale, 0.0)
    relations = replace(alike, relation_sigma=np.ones_like(problem.relation_sigma)).equations(state).relations
    used = relations.columns != NONE
    pull = np.where(used, np.abs(relations.values) * size[relations.columns], 0.0).max(axis=1, initial=0.0)
    return replace(alike, relation_sigma=np.where(pull > 0.0, pull, 1.0))


def orders_apart(problem: Problem, alike: Problem) -> float:
    """Orders of magnitude between the largest and the smallest sigma, each over that of the levelled problem."""
    ratio = np.concatenate([(problem.sigma / alike.sigma).ravel(), problem.relation_sigma / alike.relation_sigma])
    return float(np.log10(ratio.max(initial=1.0) / ratio.min(initial=1.0)))
