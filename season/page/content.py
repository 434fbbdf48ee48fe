"""What the page shows, read from the tables."""

from dataclasses import dataclass
from datetime import date, datetime
from typing import Final

import duckdb
import numpy as np

from rig.arrays import Floats
from season.rows import column_of
from season.tables.comparison import Group, groups
from season.tables.database import asked

#: Quantities of the page, and where they are taken, m from the take-off.
SHOWN: Final = (("alpha", 10), ("angle_of_attack", 10), ("speed", 0), ("height", 20))
#: Jumps to look at and logs that were passed over, which the page lists.
MOST: Final = 100
_COUNTS: Final = """
    SELECT min(day), max(day), count(*), count(DISTINCT athlete), count(DISTINCT hill), count(DISTINCT day),
        count_if(NOT ok), (SELECT count(*) FROM logs WHERE state = 'failed') FROM jumps
"""
_LOOK: Final = """
    SELECT time_utc, coalesce(athlete, ''), hill, verdict, report FROM jumps WHERE NOT ok
    ORDER BY time_utc DESC LIMIT ?
"""
_FAILED: Final = "SELECT NULL, log, hill, problem, '' FROM logs WHERE state = 'failed' ORDER BY log LIMIT ?"
#: Days on which somebody jumped, counted from 0: there is nothing to draw between seasons.
_DAYS: Final = """
    WITH days AS (SELECT day, row_number() OVER (ORDER BY day) - 1 AS since FROM (SELECT DISTINCT day FROM jumps))
"""
_JUMPS: Final = """{days}
    SELECT athlete, since, {column}, report, hill, day FROM jumps JOIN days USING (day)
    WHERE ok AND athlete IS NOT NULL AND {column} IS NOT NULL ORDER BY time_utc
"""
_HILLS: Final = """{days}
    SELECT hill, since, avg({column}), stddev_samp({column}) / sqrt(count(*)) FROM jumps JOIN days USING (day)
    WHERE ok AND athlete IS NOT NULL AND {column} IS NOT NULL GROUP BY hill, since ORDER BY hill, since
"""
_CAMERAS: Final = """{days}
    SELECT hill, camera, since, {places}, {sigmas}
    FROM cameras JOIN (SELECT DISTINCT key, day FROM jumps) USING (key) JOIN days USING (day)
    GROUP BY hill, camera, since ORDER BY hill, camera, since
"""


@dataclass(frozen=True, slots=True, eq=False)
class Dots:
    """Jumps as dots.

    Attributes:
        days: (n,) of jumping, counted from 0.
        values: (n,) of the quantity.
        reports: of each the coach's page.
        words: of each day and hill, for who points at it.
    """

    days: Floats
    values: Floats
    reports: list[str]
    words: list[str]


@dataclass(frozen=True, slots=True, eq=False)
class Athlete:
    """An athlete in one quantity: means, and all good jumps."""

    group: Group
    dots: Dots


@dataclass(frozen=True, slots=True, eq=False)
class Means:
    """Means by day: (n,) days of jumping, means and their standard deviations (NaN of a single jump)."""

    days: Floats
    values: Floats
    sigmas: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Quantity:
    """A quantity: athletes from the largest to the smallest, and the means of each hill by day."""

    name: str
    distance_m: int
    athletes: list[Athlete]
    hills: dict[str, Means]


@dataclass(frozen=True, slots=True)
class ToLookAt:
    """A jump that a person should look at, or a log that was passed over."""

    when: datetime | None
    who: str
    hill: str
    why: str
    report: str


@dataclass(frozen=True, slots=True, eq=False)
class Drift:
    """How far a camera was from its median position: (n,) days of jumping and (n, 3) mm with (n, 3) sigmas."""

    hill: str
    camera: str
    days: Floats
    away_mm: Floats
    sigma_mm: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Content:
    """Everything on the page.

    Attributes:
        campaign: its name.
        first, last: days; None without jumps.
        counts: jumps, athletes, hills, days; jumps to look at and logs passed over in all.
        look: jumps to look at, the newest first.
        passed_over: logs.
        quantities: of `SHOWN` that were measured.
        drifts: of the cameras.
    """

    campaign: str
    first: date | None
    last: date | None
    counts: dict[str, int]
    look: list[ToLookAt]
    passed_over: list[ToLookAt]
    quantities: list[Quantity]
    drifts: list[Drift]

    @property
    def between(self) -> str:
        """First and last day."""
        return f"{self.first} \N{EN DASH} {self.last}"


def content_of(database: duckdb.DuckDBPyConnection) -> Content:
    """Read everything that the page shows."""
    ((campaign,),) = asked(database, "SELECT campaign FROM about")[1]
    ((first, last, *numbers),) = asked(database, _COUNTS)[1]
    names = ("jumps", "athletes", "hills", "days", "look", "failed")
    look, failed = (asked(database, sql, [MOST])[1] for sql in (_LOOK, _FAILED))
    return Content(
        campaign,
        first,
        last,
        dict(zip(names, numbers, strict=True)),
        [ToLookAt(*row) for row in look],
        [ToLookAt(*row) for row in failed],
        [found for name, distance in SHOWN if (found := _quantity(database, name, distance)) is not None],
        _drifts(database),
    )


def _quantity(database: duckdb.DuckDBPyConnection, name: str, distance_m: int) -> Quantity | None:
    column = column_of(name, distance_m)
    rows = asked(database, _JUMPS.format(days=_DAYS, column=column))[1]
    if not rows:
        return None
    of_athlete: dict[str, list[int]] = {}
    for at, row in enumerate(rows):
        of_athlete.setdefault(row[0], []).append(at)
    athletes = []
    for group in groups(database, name, distance_m):
        own = [rows[at] for at in of_athlete[group.of["athlete"] or ""]]
        dots = Dots(
            np.array([row[1] for row in own], float), np.array([row[2] for row in own]), [row[3] for row in own],
            [f"{row[5]} {row[4]}" for row in own],
        )  # fmt: skip
        athletes.append(Athlete(group, dots))
    by_day = asked(database, _HILLS.format(days=_DAYS, column=column))[1]
    hills = {}
    for hill in sorted({row[0] for row in by_day}):
        numbers = np.array([row[1:] for row in by_day if row[0] == hill], float)
        hills[hill] = Means(*numbers.T)
    return Quantity(name, distance_m, athletes, hills)


def _drifts(database: duckdb.DuckDBPyConnection) -> list[Drift]:
    """By day, as a calibration is made of many logs."""
    places = ", ".join(f"1e3 * avg(X0_{axis}_m)" for axis in "XYZ")
    sigmas = ", ".join(f"1e3 * sqrt(avg(X0_{axis}_sigma_m ** 2))" for axis in "XYZ")
    rows = asked(database, _CAMERAS.format(days=_DAYS, places=places, sigmas=sigmas))[1]
    found = []
    for hill, camera in dict.fromkeys(row[:2] for row in rows):
        numbers = np.array([row[2:] for row in rows if row[:2] == (hill, camera)], float)
        away = numbers[:, 1:4] - np.median(numbers[:, 1:4], axis=0)
        found.append(Drift(hill, camera, numbers[:, 0], away, numbers[:, 4:7]))
    return found
