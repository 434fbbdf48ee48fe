"""Optional parts of a result file: detectable blunders, joint covariances, another datum."""

from collections.abc import Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from typing import Any

import numpy as np

from photogrammetry.adjustment.equations.relations import Kind
from photogrammetry.adjustment.run import Outcome
from photogrammetry.adjustment.solution.adjustment import Adjustment
from photogrammetry.adjustment.solution.datum import DatumError
from photogrammetry.network.model import Network, Role
from rig.arrays import Floats, Integers
from rig.errors import BadInputError


def in_datum_of(outcome: Outcome, patterns: Sequence[str]) -> Outcome:
    """The outcome of a free network with all sigmas in the datum of some of its points (S-transformation).

    Coordinates stay: the new datum points are where they are.

    Args:
        outcome: of a free network.
        patterns: names of the datum points, with `*` and `?`.

    Raises:
        BadInputError: a pattern fits no point, the network is not free, or the points do not define the datum.
    """
    a = outcome.adjustment
    points = named_points(a.network, patterns, "--datum")
    fixed = [a.network.points[i].name for i in points if a.network.points[i].role is Role.FIXED]
    if fixed:
        raise BadInputError(f"--datum: point {fixed[0]} is fixed; leave it out")
    if not a.free.defect:
        raise BadInputError(
            '--datum: nothing is free in this network; give it "datum": {"type": "inner"} or drop --datum'
        )
    try:
        return replace(outcome, adjustment=a.in_datum(points))
    except DatumError as error:
        raise BadInputError(
            f"--datum: these points leave {error.missing} of {a.free.defect} conditions open; name three that are not "
            "on a line"
        ) from None


def joint_covariance(a: Adjustment, patterns: Sequence[str]) -> dict[str, Any]:
    """The covariance of some points together, cross terms between them included.

    Args:
        a: the adjustment.
        patterns: names of the points, with `*` and `?`.

    Raises:
        BadInputError: a pattern fits no point.
    """
    points = named_points(a.network, patterns, "--covariance")
    columns = a.problem.unknowns.point[points].ravel()
    return {"points": [a.network.points[i].name for i in points], "covariance": a.covariance(columns).tolist()}


def with_detectable(result: dict[str, Any], a: Adjustment) -> dict[str, Any]:
    """The result with the minimal detectable blunder of each observation: it would be found in four of five cases.

    In the unit of the observation; null where the observation is not controlled.
    """
    images = a.image_detectable()[np.argsort(a.problem.order)]
    relations, kinds = a.relation_detectable(), a.problem.relations
    control = relations[kinds.rows(Kind.CONTROL)].reshape(-1, 3)
    lists: dict[str, list[Any]] = {
        "observations": [_listed(pair) for pair in images],
        "control": [_listed(triple) for triple in control],
        "distances": _listed(relations[kinds.rows(Kind.DISTANCE)]),
        "differences": _listed(relations[kinds.rows(Kind.DIFFERENCE)]),
    }
    return result | {
        key: [entry | {"detectable": value} for entry, value in zip(result[key], values, strict=True)]
        for key, values in lists.items()
    }


def named_points(network: Network, patterns: Sequence[str], option: str) -> Integers:
    """Indices of the points that the patterns name, in the network's order.

    Raises:
        BadInputError: a pattern fits no point.
    """
    names = [point.name for point in network.points]
    for pattern in patterns:
        if not any(fnmatchcase(name, pattern) for name in names):
            raise BadInputError(f'{option}: no point is called "{pattern}"; name points of the network')
    return np.array([i for i, name in enumerate(names) if any(fnmatchcase(name, p) for p in patterns)], dtype=np.intp)


def _listed(values: Floats) -> list[float | None]:
    return [float(value) if np.isfinite(value) else None for value in values]
