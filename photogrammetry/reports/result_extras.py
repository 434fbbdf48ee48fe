"""Optional parts of a result file: detectable blunders, joint covariances, another datum."""

from collections.abc import Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from typing import Any

import numpy as np
from numpy.typing import NDArray

from photogrammetry.adjustment.equations.relations import Kind
from photogrammetry.adjustment.run import Outcome
from photogrammetry.adjustment.solution.adjustment import Adjustment
from photogrammetry.adjustment.solution.datum import DatumError
from photogrammetry.adjustment.solution.reliability import Effects, reliability
from photogrammetry.network.model import Network, Role
from rig.arrays import Flags, Floats, Integers
from rig.errors import BadInputError

_RELIABILITY = ("detectable", "effect", "effect_on")


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
    """The result with the minimal detectable blunder of each observation, and what it would do.

    `detectable`, in the unit of the observation, would be found in four of five cases; null where nothing controls it.
    `effect` is the largest displacement of a point or projection centre by an error of that size, and
    `effect_on` names that place; one per coordinate.
    """
    found, kinds, back = reliability(a), a.problem.relations, np.argsort(a.problem.order)
    relations = _entries(a, a.relation_detectable(), found.relation)
    control = kinds.rows(Kind.CONTROL).reshape(-1, 3)
    images = _entries(a, a.image_detectable()[back], Effects(found.image.length[back], found.image.place[back]))
    lists = {
        "observations": images,
        "control": [{key: [relations[row][key] for row in rows] for key in _RELIABILITY} for rows in control],
        "distances": [relations[row] for row in kinds.rows(Kind.DISTANCE)],
        "differences": [relations[row] for row in kinds.rows(Kind.DIFFERENCE)],
    }
    return result | {
        key: [entry | more for entry, more in zip(result[key], values, strict=True)] for key, values in lists.items()
    }


def _entries(a: Adjustment, detectable: Floats, effects: Effects) -> list[dict[str, Any]]:
    """For each observation (n,) or pair (n, 2): number or list under each key."""
    names = [*(f"point {point.name}" for point in a.network.points), *(f"image {i.name}" for i in a.network.images)]
    known = np.isfinite(detectable)
    values = (detectable, effects.length, np.array(names, dtype=object)[effects.place])
    columns = (_where(known, column) for column in values)
    return [dict(zip(_RELIABILITY, row, strict=True)) for row in zip(*columns, strict=True)]


def _where(known: Flags, column: NDArray[Any]) -> list[Any]:
    """The column as a list, None where it has no value."""
    column = column.astype(object)
    column[~known] = None
    values: list[Any] = column.tolist()
    return values


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
