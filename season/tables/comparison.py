"""Whether athletes differ from the others: by the days that they share, corrected for the number of comparisons.

On a day and hill everybody has the same snow, wind to a degree, and the same calibration, so the differences of one day
have these in common and their scatter over the days says how sure the mean difference is (a t test of the days'
differences). P values are corrected for their number by the false discovery rate (Benjamini and Hochberg, 1995).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import duckdb
import numpy as np
from scipy.special import stdtr
from scipy.stats import false_discovery_control

from analysis.report.course import NAMES
from rig.errors import BadInputError
from season.rows import DISTANCES_M, column_of
from season.tables.database import asked

#: Share of false ones among the differences that are marked.
RATE: Final = 0.05
#: Days that a test needs.
FEWEST_DAYS: Final = 3
_BY: Final = ("athlete", "hill", "gate", "season")
_SQL: Final = """
    WITH chosen AS (
        SELECT {by}, day, athlete AS who, hill AS place, calibration, {value} AS value, {sigma} AS sigma
        FROM jumps WHERE ok AND athlete IS NOT NULL AND {value} IS NOT NULL),
    whole AS (SELECT {others}, place, day, sum(value) AS total, count(*) AS n FROM chosen GROUP BY ALL),
    own AS (SELECT {by}, who, place, day, sum(value) AS total, count(*) AS n FROM chosen GROUP BY ALL),
    days AS (
        SELECT {own_by}, if(whole.n > own.n,
            own.total / own.n - (whole.total - own.total) / (whole.n - own.n), NULL) AS difference
        FROM own JOIN whole ON {same}),
    compared AS (
        SELECT {by}, count(difference) AS days, avg(difference) AS difference,
            stddev_samp(difference) / sqrt(count(difference)) AS sigma_difference
        FROM days GROUP BY ALL),
    means AS (
        SELECT {by}, count(*) AS jumps, avg(value) AS mean, stddev_samp(value) AS scatter,
            sqrt(coalesce(var_samp(value), 0) / count(*) + avg(sigma ** 2) / count(DISTINCT calibration)) AS sigma_mean
        FROM chosen GROUP BY ALL)
    SELECT {means_by}, jumps, mean, sigma_mean, scatter, days, difference, sigma_difference
    FROM means JOIN compared ON {compared} ORDER BY mean DESC
"""


@dataclass(frozen=True, slots=True)
class Group:
    """The jumps of an athlete, of all or of one hill, gate, season.

    Attributes:
        of: values of athlete, hill, gate, season, as far as the groups differ by them.
        jumps: how many.
        mean: of the quantity.
        sigma_mean: of it: the scatter of the jumps, and errors of measurement as if all jumps of a calibration shared
            them.
        scatter: standard deviation of single jumps; None of one jump.
        days: on which others jumped there too.
        difference: from the others on the same days; None without such days.
        sigma_difference: by the scatter over the days; None with fewer than two.
        p: probability of such a difference if there is none, corrected; None with fewer than `FEWEST_DAYS`.
    """

    of: dict[str, str | None]
    jumps: int
    mean: float
    sigma_mean: float
    scatter: float | None
    days: int
    difference: float | None
    sigma_difference: float | None
    p: float | None

    @property
    def differs(self) -> bool:
        """Whether it is marked."""
        return self.p is not None and self.p < RATE


def groups(
    database: duckdb.DuckDBPyConnection, quantity: str, distance_m: int, by: Sequence[str] = ("athlete",)
) -> list[Group]:
    """Means of a quantity of good jumps by athlete, and how they differ from those of the others.

    The others are those who jumped on the same day and hill, and from the same gate if it is among `by`.

    Args:
        database: the tables.
        quantity: of `analysis.report.course.NAMES`.
        distance_m: one of `DISTANCES_M`.
        by: athlete, and what else the groups differ by: hill, gate, season.

    Raises:
        BadInputError: there is no such quantity or distance.
    """
    refuse_unknown(quantity, distance_m)
    if "athlete" not in by or not set(by) <= set(_BY):
        raise BadInputError(f"by {', '.join(by)}: groups are by athlete, and by hill, gate or season too")
    others = [name for name in by if name in {"gate", "season"}]
    sql = _SQL.format(
        by=", ".join(by),
        others=", ".join([*others, "'' AS none"]),
        own_by=", ".join(f"own.{name}" for name in by),
        means_by=", ".join(f"means.{name}" for name in by),
        same=" AND ".join(f"own.{name} IS NOT DISTINCT FROM whole.{name}" for name in [*others, "place", "day"]),
        compared=" AND ".join(f"means.{name} IS NOT DISTINCT FROM compared.{name}" for name in by),
        value=column_of(quantity, distance_m),
        sigma=column_of(quantity, distance_m, sigma=True),
    )
    _, rows = asked(database, sql)
    return _tested([_group(by, row) for row in rows])


def refuse_unknown(quantity: str, distance_m: int) -> None:
    """Refuse a quantity that jumps do not have.

    Raises:
        BadInputError: there is no such quantity or distance.
    """
    if quantity not in NAMES or distance_m not in DISTANCES_M:
        raise BadInputError(
            f"{quantity} at {distance_m} m: there are {', '.join(NAMES)} at {', '.join(map(str, DISTANCES_M))} m"
        )


def _group(by: Sequence[str], row: tuple[Any, ...]) -> Group:
    jumps, mean, sigma_mean, scatter, days, difference, sigma = row[len(by) :]
    p = None
    if days >= FEWEST_DAYS and sigma:
        p = float(2 * stdtr(days - 1, -abs(difference) / sigma))
    of = dict(zip(by, row, strict=False))
    return Group(of, jumps, mean, sigma_mean, scatter, days, difference, sigma, p)


def _tested(found: list[Group]) -> list[Group]:
    """The groups with p values that are corrected for their number."""
    tested = [group for group in found if group.p is not None]
    if not tested:
        return found
    corrected = iter(false_discovery_control(np.array([group.p for group in tested])).tolist())
    return [group if group.p is None else replace(group, p=next(corrected)) for group in found]
