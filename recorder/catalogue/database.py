"""The file of the catalogue, in SQLite: made anew whenever it is not to be believed.

It is believed if it is of this program's version, owned by this process's user, writable by nobody else, and sound; a
row of it, if its checksum is right.
"""

import os
import sqlite3
import stat
from collections.abc import Iterable, Sequence
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

import msgspec
from isal.isal_zlib import crc32

from recorder.log.beside import numbered

NAME: Final = ".svev-catalogue.db"
#: The file, and what SQLite keeps beside it while it is open.
FILES: Final = (NAME, f"{NAME}-wal", f"{NAME}-shm")
#: What earlier versions kept.
_EARLIER: Final = ".svev-catalogue"
#: Some 300 000 recordings; a larger file was not written by us.
_BYTES_MAX: Final = 1 << 30
_WAIT_S: Final = 5.0
#: What a damaged file raises; SQLite names a damaged text, and the name may be no UTF-8.
DAMAGED: Final = (sqlite3.DatabaseError, UnicodeDecodeError, msgspec.MsgspecError)
#: Errors by which nothing is wrong with the file: another program holds it, there is no room, nobody may write here.
_IN_THE_WAY: Final = frozenset(
    {sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED, sqlite3.SQLITE_FULL, sqlite3.SQLITE_READONLY, sqlite3.SQLITE_CANTOPEN}
)
#: Counts up when rows of the same log become different ones.
_FORMAT: Final = 4
_VERSION: Final = crc32(f"{version('svev')}.{_FORMAT}".encode()) & 0x7FFF_FFFF

#: Main figures of a jump that are searched for, as `rig.api.jump.LastJump` names them.
FIGURES: Final = ("takeoff_speed", "perpendicular", "speed_20_m", "angle_of_attack", "ski_to_body")
_COLUMNS: Final = {
    "logs": ("path", "deleted", "growing", "keys", "plain", "entry"),
    "recordings": (
        "path", "id", "deleted", "time_ns", "duration_s", "level", "athlete", "bib", "bib_number", "favourite", "tags",
        "continues", "next_part", "part", "hill", "text", "session", "said",
    ),
    "joined": ("path", "entry"),
    "jumps": ("path", "jump", "time_ns", "live", "ok", *FIGURES, "content"),
}  # fmt: skip
_SCHEMA: Final = f"""
CREATE TABLE logs (
  path TEXT PRIMARY KEY, deleted INTEGER, growing INTEGER, keys BLOB, plain BLOB, entry BLOB, checksum INTEGER
) WITHOUT ROWID;
CREATE INDEX logs_growing ON logs (deleted) WHERE growing;
CREATE TABLE recordings (
  path TEXT PRIMARY KEY, id TEXT, deleted INTEGER, time_ns INTEGER, duration_s REAL, level TEXT, athlete TEXT, bib TEXT,
  bib_number INTEGER, favourite INTEGER, tags TEXT, continues TEXT, next_part TEXT, part INTEGER, hill TEXT,
  text TEXT, session TEXT, said TEXT, checksum INTEGER);
CREATE INDEX recordings_time ON recordings (deleted, time_ns, id);
CREATE INDEX recordings_athlete ON recordings (athlete);
CREATE INDEX recordings_continues ON recordings (continues) WHERE continues != '';
CREATE TABLE joined (path TEXT PRIMARY KEY, entry BLOB, checksum INTEGER) WITHOUT ROWID;
CREATE TABLE jumps (
  path TEXT, jump INTEGER, time_ns INTEGER, live INTEGER, ok INTEGER, {", ".join(f"{name} REAL" for name in FIGURES)},
  content BLOB, checksum INTEGER, PRIMARY KEY (path, jump)) WITHOUT ROWID;
CREATE INDEX jumps_time ON jumps (time_ns);
PRAGMA user_version = {_VERSION};
"""


def open_database(directory: Path) -> sqlite3.Connection:
    """The catalogue's file of a folder, open; in memory alone if the folder cannot keep it.

    Any thread may use the connection, but not two at once.
    """
    path = directory / NAME
    with suppress(OSError):
        (directory / _EARLIER).unlink(missing_ok=True)
    for _ in range(2):
        try:
            if not _is_ours(directory):
                _remove(directory)
            return _opened(path)
        except DAMAGED as error:
            if getattr(error, "sqlite_errorcode", sqlite3.SQLITE_CORRUPT) & 0xFF in _IN_THE_WAY:
                break
            with suppress(OSError):
                _remove(directory)
        except OSError:
            break
    return in_memory()


def in_memory() -> sqlite3.Connection:
    """A catalogue that nobody keeps."""
    connection = sqlite3.connect(":memory:", check_same_thread=False, isolation_level=None)
    connection.executescript(_SCHEMA)
    return connection


def put(connection: sqlite3.Connection, table: str, values: Sequence[Any]) -> None:
    """Write a row, in place of an earlier one.

    Args:
        connection: to the catalogue.
        table: its name.
        values: of its columns, in their order.
    """
    marks = ", ".join("?" * (len(values) + 1))
    connection.execute(f"INSERT OR REPLACE INTO {table} VALUES ({marks})", (*values, _checksum(values)))  # noqa: S608


def remove(connection: sqlite3.Connection, path: str) -> None:
    """Forget a log."""
    for table in _COLUMNS:
        connection.execute(f"DELETE FROM {table} WHERE path = ?", (path,))  # noqa: S608


def _is_ours(directory: Path) -> bool:
    """Whether nobody but this process's user can have written what stands there; also if nothing does."""
    for name in FILES:
        try:
            status = (directory / name).lstat()
        except FileNotFoundError:
            continue
        own = stat.S_ISREG(status.st_mode) and status.st_uid == os.geteuid() and not status.st_mode & 0o022
        if not own or status.st_size > _BYTES_MAX:
            return False
    return True


def _remove(directory: Path) -> None:
    for name in FILES:
        (directory / name).unlink(missing_ok=True)


def _opened(path: Path) -> sqlite3.Connection:
    """Open the file, which is made if it is missing.

    Raises:
        sqlite3.DatabaseError: it is no such file, or damaged.
        OSError: it cannot be made.
    """
    flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC | os.O_NONBLOCK
    descriptor = os.open(path, flags, 0o600)
    empty = os.fstat(descriptor).st_size == 0
    os.close(descriptor)
    connection = sqlite3.connect(path, timeout=_WAIT_S, check_same_thread=False, isolation_level=None)
    try:
        # The log in front of the file keeps it whole after a power cut; what is lost of the newest is read again.
        connection.execute("PRAGMA journal_mode = WAL").close()
        connection.execute("PRAGMA synchronous = NORMAL").close()
        if empty and connection.execute("PRAGMA user_version").fetchone() == (0,):
            connection.executescript(f"BEGIN IMMEDIATE; {_SCHEMA} COMMIT;")
        else:
            _check(connection)
    except BaseException:
        connection.close()
        raise
    return connection


def _check(connection: sqlite3.Connection) -> None:
    """Check that a file is of this version and sound; forget rows that are not.

    Raises:
        sqlite3.DatabaseError: it is not.
    """
    if connection.execute("PRAGMA user_version").fetchone() != (_VERSION,):
        raise sqlite3.DatabaseError("of another version")
    if connection.execute("PRAGMA integrity_check").fetchone() != ("ok",):
        raise sqlite3.DatabaseError("damaged")
    broken: set[str] = set()
    for table, columns in _COLUMNS.items():
        rows: Iterable[tuple[Any, ...]] = connection.execute(f"SELECT {', '.join(columns)}, checksum FROM {table}")  # noqa: S608
        broken |= {row[0] for row in rows if row[-1] != _checksum(row[:-1])}
    if any(not isinstance(path, str) for path in broken):
        raise sqlite3.DatabaseError("damaged")
    if broken:  # with them go the other parts of split recordings, which stand in one row
        firsts = {numbered(Path(path))[0] for path in broken}
        logs = connection.execute("SELECT path FROM logs").fetchall()
        broken |= {path for (path,) in logs if numbered(Path(path))[0] in firsts}
    for path in broken:
        remove(connection, path)


def _checksum(values: Sequence[Any]) -> int:
    return int(crc32(repr(tuple(values)).encode("utf-8", "surrogatepass")))
