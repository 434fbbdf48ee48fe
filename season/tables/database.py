"""The tables of a season: one DuckDB file and Parquet files, made from the results beside the logs.

They hold nothing of their own: deleted, they are made again by the next run. What a result holds of all logs is joined
into one file of rows and read at once, since ten thousand small files are slow to read.
"""

import csv
import hashlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import duckdb

from recorder.log.session_changes import session_changes, session_path
from rig.errors import BadInputError, StorageError
from rig.host.disk import sync
from season.campaign import Campaign
from season.rows import Table, tables
from season.running.logs import SeasonLog, day_of
from season.running.outcome import VERSION, LogState
from season.running.stores import is_remote, read_results, result_url

DATABASE: Final = "season.duckdb"
#: Files of rows that are joined at a time.
_AT_A_TIME: Final = 500
_NEW: Final = ".new"
#: Fields of the session that may have been corrected after the measuring.
_CORRECTED: Final = ("athlete", "bib", "gate", "wind")
_LOGS: Final = Table(
    "logs",
    {
        "log": "VARCHAR", "hill": "VARCHAR", "named_day": "DATE", "state": "VARCHAR", "problem": "VARCHAR",
        "key": "VARCHAR", "copy_of": "VARCHAR", "report": "VARCHAR", "jumps": "INTEGER", "duration_s": "DOUBLE",
        "measured_utc": "TIMESTAMP", "host": "VARCHAR", **dict.fromkeys(_CORRECTED, "VARCHAR"),
    },
)  # fmt: skip
_JUMPS: Final = """
    CREATE TABLE jumps AS
    SELECT
        if(month(day) >= 7, printf('%d/%02d', year(day), (year(day) + 1) % 100),
           printf('%d/%02d', year(day) - 1, year(day) % 100)) AS season,
        * FROM (
            SELECT logs.hill, coalesce(logs.named_day, rows.time_utc::DATE) AS day, logs.log, logs.report,
                rows.* REPLACE (
                    coalesce(logs.athlete, rows.athlete) AS athlete, coalesce(logs.bib, rows.bib) AS bib,
                    coalesce(logs.gate, rows.gate) AS gate, coalesce(logs.wind, rows.wind) AS wind)
            FROM rows_jumps AS rows JOIN logs USING (key) WHERE logs.copy_of IS NULL)
    ORDER BY time_utc, log, jump
"""
#: Logs whose jumps equal those of another log of the hill bit by bit: an archived copy of the same images.
_ARCHIVES: Final = """
    WITH measured AS (SELECT key, list(hash({columns}) ORDER BY jump) AS found FROM rows_jumps GROUP BY key),
    originals AS (
        SELECT hill, found, arg_min(log, length(log)) AS original
        FROM logs JOIN measured USING (key) WHERE copy_of IS NULL GROUP BY hill, found)
    UPDATE logs SET copy_of = originals.original FROM originals, measured
    WHERE logs.key = measured.key AND measured.found = originals.found AND logs.hill = originals.hill
        AND logs.copy_of IS NULL AND logs.log <> originals.original
"""
_OTHERS: Final = """
    CREATE TABLE {table} AS
    SELECT logs.hill, rows.* FROM rows_{table} AS rows JOIN logs USING (key) WHERE logs.copy_of IS NULL
    ORDER BY logs.log
"""


def build(campaign: Campaign, logs: Sequence[SeasonLog], *, force: bool = False) -> bool:
    """Make the tables of a campaign, unless they are of these very results.

    Args:
        campaign: it.
        logs: with what came of them.
        force: make them in any case.

    Returns:
        Whether they were made.

    Raises:
        StorageError: the disk refuses, or a result vanished meanwhile: run again.
    """
    rows = _log_rows(logs)
    mark = hashlib.sha256(repr((VERSION, campaign.name, rows)).encode()).hexdigest()
    if not force and _mark_of(campaign.out / DATABASE) == mark:
        return False
    try:
        with TemporaryDirectory(prefix=".tables-", dir=campaign.out) as scratch:
            made = Path(scratch) / DATABASE
            with duckdb.connect(made) as database:
                _fill(database, Path(scratch), campaign, logs, rows, mark)
                names = [name for (name,) in database.execute("SELECT table_name FROM duckdb_tables()").fetchall()]
                for name in names:
                    parquet = Path(scratch) / f"{name}.parquet"
                    database.execute(f"COPY {name} TO '{_quoted(parquet)}' (FORMAT parquet, COMPRESSION zstd)")
            for table in (*(Path(scratch) / f"{name}.parquet" for name in names), made):  # the mark is in the last one
                sync(table)
                table.replace(campaign.out / table.name)
            sync(campaign.out)
    except (OSError, duckdb.IOException) as error:
        raise StorageError(f"{campaign.out}: the tables cannot be made ({error}); run the season again") from error
    return True


@contextmanager
def opened(out: Path) -> Iterator[duckdb.DuckDBPyConnection]:
    """The tables of a campaign, to read: no statement can change them, or read or write any other file.

    Args:
        out: folder of the campaign.

    Raises:
        BadInputError: there are none.
    """
    path = out / DATABASE
    if not path.is_file():
        raise BadInputError(f"{path}: no such file; make it by svev season run CAMPAIGN.toml")
    try:
        database = duckdb.connect(path, read_only=True, config={"enable_external_access": "false"})
    except duckdb.Error as error:
        raise BadInputError(
            f"{path}: is no table of a season ({_first_line(error)}); delete it and run the season"
        ) from error
    with database:
        yield database


def asked(
    database: duckdb.DuckDBPyConnection, sql: str, values: Sequence[Any] = ()
) -> tuple[list[str], list[tuple[Any, ...]]]:
    """Ask the tables.

    Returns:
        Names of the columns, and the rows.

    Raises:
        BadInputError: the statement is wrong, or wants to change something.
    """
    try:
        answer = database.execute(sql, list(values))
        columns = [each[0] for each in answer.description or ()]
        return columns, answer.fetchall()
    except duckdb.Error as error:
        raise BadInputError(f"{_first_line(error)}; {_remedy(error)}") from error


def _fill(
    database: duckdb.DuckDBPyConnection,
    scratch: Path,
    campaign: Campaign,
    logs: Sequence[SeasonLog],
    rows: list[tuple[Any, ...]],
    mark: str,
) -> None:
    with (scratch / _LOGS.file).open("w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows(rows)
    _read(database, _LOGS, "logs", scratch)
    seen = {row[5]: row[0] for row in reversed(rows) if row[3] == LogState.DONE}  # of equal logs the first one
    counted = set(seen.values())
    wanted = [log.url for log in logs if log.url in counted]
    for table in tables():
        with (scratch / table.file).open("wb") as joined:
            for start in range(0, len(wanted), _AT_A_TIME):
                some = wanted[start : start + _AT_A_TIME]
                for url, content in zip(some, read_results(some, table.file, campaign.store), strict=True):
                    if content is None:
                        raise StorageError(f"{result_url(url)}: the result is gone; run the season again")
                    joined.write(content)
        _read(database, table, f"rows_{table.name}", scratch)
        if table.name == "jumps":
            columns = ", ".join(f'"{column}"' for column in table.columns if column != "key")
            database.execute(_ARCHIVES.format(columns=columns))
        (scratch / table.file).unlink()
        database.execute(_JUMPS if table.name == "jumps" else _OTHERS.format(table=table.name))
        database.execute(f"DROP TABLE rows_{table.name}")
    database.execute("ALTER TABLE logs DROP named_day")
    for field in _CORRECTED:
        database.execute(f"ALTER TABLE logs DROP {field}")
    database.execute("CREATE TABLE about AS SELECT ? AS campaign, ? AS svev, ? AS mark", [campaign.name, VERSION, mark])


def _read(database: duckdb.DuckDBPyConnection, table: Table, name: str, scratch: Path) -> None:
    columns = ", ".join(f"'{column}': '{kind}'" for column, kind in table.columns.items())
    database.execute(
        f"CREATE TABLE {name} AS SELECT * FROM read_csv('{_quoted(scratch / table.file)}', header = false, "  # noqa: S608 - names of our own
        f"auto_detect = false, delim = ',', quote = '\"', escape = '\"', nullstr = '', columns = {{{columns}}})"
    )


def _log_rows(logs: Sequence[SeasonLog]) -> list[tuple[Any, ...]]:
    """Rows of the table of logs; a log that is a copy of another one names it, and its jumps count once."""
    first: dict[str, str] = {}
    rows: list[tuple[Any, ...]] = []
    for log in logs:
        found = log.outcome
        day = day_of(log.url)
        row = [log.url, log.hill, "" if day is None else day.isoformat()]
        if found is None:
            rows.append((*row, str(LogState.WAITING), *[""] * 12))
            continue
        done = found.state is LogState.DONE
        original = first.setdefault(found.key, log.url) if done else log.url
        report = f"{result_url(log.url)}/report.html" if done and found.jumps else ""
        changed = {} if is_remote(log.url) else _changes(Path(log.url))
        rows.append(
            (
                *row,
                str(found.state),
                found.problem or "",
                found.key,
                "" if original == log.url else original,
                report,
                found.jumps,
                found.duration_s,
                found.started,
                found.host,
                *(changed.get(each, "") for each in _CORRECTED),
            )
        )
    return rows


def _changes(log: Path) -> dict[str, str]:
    try:
        return session_changes(log) if session_path(log).exists() else {}
    except BadInputError:
        return {}  # svev info says so


def _mark_of(path: Path) -> str | None:
    """By which results the tables were made; None if there are none, or not of this program."""
    if not path.is_file():
        return None
    try:
        with duckdb.connect(path, read_only=True) as database:
            (mark,) = database.execute("SELECT mark FROM about").fetchall()[0]
    except duckdb.Error:
        return None
    return str(mark)


def _quoted(path: Path) -> str:
    return str(path).replace("'", "''")


def _remedy(error: duckdb.Error) -> str:
    match error:
        case duckdb.CatalogException():
            return "SHOW TABLES says which tables there are"
        case duckdb.BinderException():
            return "DESCRIBE jumps says which columns there are"
        case duckdb.ParserException():
            return "write one statement of DuckDB's SQL, or ask a ready question by --ask"
        case _:
            return "a statement can only read the tables of the season"


def _first_line(error: duckdb.Error) -> str:
    return str(error).split("\n", 1)[0]
