"""Finds recordings and their measured jumps in the catalogue's file."""

import os
import sqlite3
from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, Final

from recorder.catalogue.entry import SUFFIX
from recorder.catalogue.search_words import Wanted, understood
from recorder.catalogue.trash import trash_of
from rig.api.athletes import JumpQuery, folded
from rig.api.recordings import RecordingQuery, Sorting
from rig.api.statement import Level
from rig.host.file_names import is_recording_id

_EPOCH: Final = datetime(1970, 1, 1, tzinfo=UTC)
_MICROSECOND: Final = timedelta(microseconds=1)
_NEWEST: Final = "time_ns DESC, id DESC"
_ORDERS: Final = {
    Sorting.NEWEST: _NEWEST,
    Sorting.OLDEST: "time_ns, id",
    Sorting.BIB: f"bib_number IS NULL, bib_number, bib = '', bib, {_NEWEST}",
    Sorting.ATHLETE: f"athlete = '', athlete, {_NEWEST}",
    Sorting.LONGEST: f"duration_s DESC, {_NEWEST}",
}
#: A recording of which a part is missing is no good one, whatever its logs say.
_GONE: Final = " OR ".join(f"(r.{part} != '' AND NOT is_here(r.{part}))" for part in ("continues", "next_part"))
_LEVEL: Final = f"CASE WHEN r.level != '{Level.ERROR}' AND ({_GONE}) THEN '{Level.WARNING}' ELSE r.level END = ?"


def is_here(directory: Path, part: str) -> bool:
    """Whether a part of a recording lies in a folder or in its trash, as its verdict says.

    It is to be known by its name to the connection that is asked.
    """
    trash = trash_of(directory)
    folders = (directory,) if trash.is_symlink() else (directory, trash)
    return is_recording_id(part) and any(os.path.lexists(folder / f"{part}{SUFFIX}") for folder in folders)


@dataclass(slots=True)
class Conditions:
    """Conditions in SQL, all of which hold, and the values in them."""

    texts: list[str] = field(default_factory=list)
    values: list[Any] = field(default_factory=list)

    def add(self, text: str, *values: Any) -> None:
        """One more."""
        self.texts.append(text)
        self.values += values

    @property
    def where(self) -> str:
        """All of them, for WHERE."""
        return " AND ".join(self.texts) or "TRUE"


def found_paths(connection: sqlite3.Connection, query: RecordingQuery) -> tuple[int, list[str]]:
    """How many recordings fit a query, and the paths of those on the page that it asks for, in its order.

    Raises:
        BadInputError: its text cannot be understood.
    """
    conditions = _of_recordings(query)
    where, values = conditions.where, conditions.values
    limit = -1 if query.limit is None else query.limit
    listed = f"SELECT path FROM recordings r WHERE {where} ORDER BY {_ORDERS[query.sort]} LIMIT ? OFFSET ?"  # noqa: S608
    paths = [row[0] for row in connection.execute(listed, (*values, limit, query.offset))]
    if not query.offset and (query.limit is None or len(paths) < query.limit):
        return len(paths), paths
    (total,) = connection.execute(f"SELECT count(*) FROM recordings r WHERE {where}", values).fetchone()  # noqa: S608
    return total, paths


def found_jumps(connection: sqlite3.Connection, query: JumpQuery, columns: str) -> Sequence[tuple[Any, ...]]:
    """Columns of the measured jumps that a query finds, newest first; none that lies in the trash.

    Args:
        connection: to the catalogue.
        query: what is wanted.
        columns: in SQL, of `j` (jumps) and `r` (their recordings).

    Raises:
        BadInputError: its text cannot be understood.
    """
    conditions, wanted = Conditions(), understood(query.search)
    conditions.add("NOT r.deleted")
    _add_wanted(conditions, wanted)
    for column, sign, bound in wanted.figures:
        conditions.add(f"j.{column} {sign} ?", bound)
    if name := folded(query.athlete):
        conditions.add("r.athlete = ?", name)
    _add_span(conditions, "j", query.since, query.until)
    listed = (
        f"SELECT {columns} FROM jumps j JOIN recordings r ON r.path = j.path WHERE {conditions.where} "  # noqa: S608
        "ORDER BY j.time_ns DESC, r.id DESC, j.jump DESC LIMIT ?"
    )
    return connection.execute(listed, (*conditions.values, -1 if query.limit is None else query.limit)).fetchall()


def _of_recordings(query: RecordingQuery) -> Conditions:
    conditions, wanted = Conditions(), understood(query.search)
    conditions.add("deleted = ?", int(query.deleted))
    _add_wanted(conditions, wanted)
    if wanted.figures:
        figures = " AND ".join(f"j.{column} {sign} ?" for column, sign, _ in wanted.figures)
        conditions.add(
            f"EXISTS (SELECT 1 FROM jumps j WHERE j.path = r.path AND {figures})",  # noqa: S608
            *(bound for *_, bound in wanted.figures),
        )
    if query.favourite is not None:
        conditions.add("favourite = ?", int(query.favourite))
    if bib := folded(query.bib):
        conditions.add("bib = ?", bib)
    if athlete := folded(query.athlete):
        conditions.add("instr(athlete, ?)", athlete)
    if query.tag:
        conditions.add("instr(tags, ?)", _tag(query.tag))
    if query.verdict is not None:
        conditions.add(_LEVEL, query.verdict.value)
    _add_span(conditions, "r", query.since, query.until)
    return conditions


def _add_wanted(conditions: Conditions, wanted: Wanted) -> None:
    """The conditions of a text, without those on figures."""
    for word in wanted.words:
        conditions.add("instr(r.text, ?)", word)
    for name, part in wanted.fields:
        if name in {"athlete", "hill"}:
            conditions.add(f"instr(r.{name}, ?)", part)
        elif name == "bib":
            conditions.add("r.bib = ?", part)
        else:
            conditions.add("instr(coalesce(json_extract(r.session, ?), ''), ?)", f'$."{name}"', part)
    for sign, seconds in wanted.durations:
        conditions.add(f"r.duration_s {sign} ?", seconds)
    for level in wanted.levels:
        conditions.add(_LEVEL, level.value)
    for tag in wanted.tags:
        conditions.add("instr(r.tags, ?)", _tag(tag))
    if wanted.favourite is not None:
        conditions.add("r.favourite = ?", int(wanted.favourite))
    for since in wanted.since:
        _add_span(conditions, "r", since, None)
    for until in wanted.until:
        _add_span(conditions, "r", None, until)


def _add_span(conditions: Conditions, table: str, since: datetime | None, until: datetime | None) -> None:
    if since is not None:
        conditions.add(f"{table}.time_ns >= ?", in_ns(since))
    if until is not None:
        conditions.add(f"{table}.time_ns < ?", in_ns(until))


def _tag(tag: str) -> str:
    return f"\n{folded(tag)}\n"


def in_ns(time: datetime) -> int:
    """A time as columns have it: UTC, ns since 1970-01-01, to the microsecond."""
    return (time - _EPOCH) // _MICROSECOND * 1000
