"""What is known of the logs of a folder: read when they are new or have changed, kept in one file beside them."""

import os
import sqlite3
import threading
import time
import weakref
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from datetime import UTC
from functools import partial
from pathlib import Path
from typing import Any, Final, Protocol, TypeVar

from recorder.catalogue import database, search
from recorder.catalogue.entry import SUFFIX, Entry, LogState, joined, read_entry, with_changes
from recorder.catalogue.file_key import FileKey, file_key, key_of
from recorder.catalogue.folder_watch import FolderWatch
from recorder.catalogue.trash import trash_of
from recorder.catalogue.whole_recordings import entries_of, int64, parts_with, put_recording
from recorder.log.beside import jumper_path, measured_path
from recorder.log.session_changes import session_path
from recorder.log.write_lock import is_being_written
from recorder.reading.log_reader import LogReader
from recorder.reading.parts import parts_of
from rig.api.athletes import JumpQuery
from rig.api.jump import LastJump
from rig.api.recordings import RecordingQuery
from rig.api.statement import Level
from rig.errors import BadInputError
from rig.host.file_names import is_recording_id
from rig.transport import wire

#: A growing log is read again when this many times the duration of the last reading has passed.
_PATIENCE: Final = 10
#: So many logs are read before what was learned of them is kept.
_TOGETHER: Final = 100
#: Keys of the log, of the changes of its session, of its results (whole and live); None: there is no such file.
Keys = tuple[FileKey | None, FileKey | None, FileKey | None, FileKey | None]
_KEYS: Final = wire.decoder(Keys)
_ENTRIES: Final = wire.decoder(Entry)
_BESIDE: Final = (session_path, measured_path, jumper_path)
_ENDINGS: Final = tuple(beside(Path("x.mcap")).name.removeprefix("x") for beside in _BESIDE)

_Answer = TypeVar("_Answer")


@dataclass(frozen=True, slots=True)
class FoundJump:
    """A measured jump.

    Attributes:
        jump: its main figures.
        live: they were measured while it was recorded, and the log was not measured yet.
    """

    jump: LastJump
    live: bool


class Judge(Protocol):
    """What the catalogue does not know by itself of a log."""

    def level(self, entry: Entry) -> Level:
        """How grave the verdict on it is."""
        ...

    def jumps(self, log: Path) -> Sequence[FoundJump]:
        """The jumps that were measured in it."""
        ...


class NoJudge:
    """Judges nothing: for programs that only list logs."""

    def level(self, entry: Entry) -> Level:  # noqa: ARG002 - as the protocol wants it
        """All are alike."""
        return Level.INFO

    def jumps(self, log: Path) -> Sequence[FoundJump]:  # noqa: ARG002 - as the protocol wants it
        """None is known."""
        return ()


class LogIndex:
    """Any thread may call any method; one is answered at a time.

    Args:
        directory: the folder; its trash belongs to it.
        judge: asked about each log that is new or has changed.
    """

    def __init__(self, directory: Path, judge: Judge) -> None:
        self._directory, self._judge = directory, judge
        self._lock, self._ending = threading.Lock(), threading.Event()
        self._connection: sqlite3.Connection | None = None
        self._close: weakref.finalize[..., LogIndex] | None = None
        self._watches = {deleted: FolderWatch(folder) for deleted, folder in self._folders().items()}
        self._fresh_until: dict[str, float] = {}  # of growing logs, on `time.monotonic`, s

    def end_reading(self) -> None:
        """Read no more new logs: thousands of them take a minute or more, and the program ends."""
        self._ending.set()

    def close(self) -> None:
        """Close the file."""
        self.end_reading()
        with self._lock:
            self._open(None)

    def entry(self, path: Path) -> Entry:
        """The entry of a file.

        Raises:
            FileNotFoundError: the file is no longer there.
        """
        name = str(path.relative_to(self._directory))
        return self._answer(lambda connection: self._look(connection, name, _keys_of(path)))

    def find(self, query: RecordingQuery) -> tuple[int, list[Entry]]:
        """How many recordings fit a query, and those on the page that it asks for, in its order.

        Raises:
            BadInputError: its text cannot be understood.
            OSError: the folder cannot be read.
        """

        def answer(connection: sqlite3.Connection) -> tuple[int, list[Entry]]:
            self._look_around(connection, deleted=query.deleted)
            total, paths = search.found_paths(connection, query)
            return total, entries_of(connection, paths)

        return self._answer(answer)

    def jumps(self, query: JumpQuery, columns: str) -> Sequence[tuple[Any, ...]]:
        """Columns of the measured jumps that a query finds, as `search.found_jumps`.

        Raises:
            BadInputError: its text cannot be understood.
            OSError: the folder cannot be read.
        """

        def answer(connection: sqlite3.Connection) -> Sequence[tuple[Any, ...]]:
            self._look_around(connection, deleted=False)
            return search.found_jumps(connection, query, columns)

        return self._answer(answer)

    def following(self, ids: Sequence[str], *, deleted: bool) -> Mapping[str, str]:
        """Which recordings go on with which of these: ids by ids; parts of the same recording do not count.

        Raises:
            OSError: the folder cannot be read.
        """

        def answer(connection: sqlite3.Connection) -> Mapping[str, str]:
            self._look_around(connection, deleted=deleted)
            wanted = "continues IN (SELECT value FROM json_each(?)) AND continues != '' AND deleted = ? AND part = 1"
            table = "recordings INDEXED BY recordings_continues"  # a few, among which SQLite would not look first
            asked = f"SELECT continues, id FROM {table} WHERE {wanted}"  # noqa: S608
            return dict(connection.execute(asked, (wire.encode(ids).decode(), int(deleted))).fetchall())

        return self._answer(answer)

    def whole(self, path: Path) -> Entry:
        """The entry of a recording by the path of its first part: with those parts that lie beside it.

        Raises:
            FileNotFoundError: the file is no longer there.
        """
        parts = parts_of(path)
        return joined([self.entry(part) for part in parts[parts.index(path) :]])

    def _folders(self) -> dict[bool, Path]:
        return {False: self._directory, True: trash_of(self._directory)}

    def _open(self, connection: sqlite3.Connection | None) -> None:
        """Use another connection, or none."""
        if self._close is not None:
            self._close()
        self._connection = connection
        # Python's connections are freed late, with what the disk is to be told last.
        self._close = None if connection is None else weakref.finalize(self, connection.close)
        if connection is not None:
            connection.create_function("is_here", 1, partial(search.is_here, self._directory))
        for watch in self._watches.values():
            watch.forget()

    def _answer(self, asked: Callable[[sqlite3.Connection], _Answer]) -> _Answer:
        """Ask the file; if it fails, a new one; if that fails too, memory."""
        with self._lock:
            for opened in (partial(database.open_database, self._directory), database.in_memory):
                if self._connection is None:
                    self._open(opened())
                try:
                    return asked(self._connection)  # type: ignore[arg-type] # it is open
                except database.DAMAGED:
                    self._open(None)
            self._open(database.in_memory())
            return asked(self._connection)  # type: ignore[arg-type] # it is open

    def _look_around(self, connection: sqlite3.Connection, *, deleted: bool) -> None:
        """Bring what is known of a folder up to date.

        Raises:
            FileNotFoundError: there is no such folder.
            OSError: it cannot be read.
        """
        watch, folder = self._watches[deleted], self._folders()[deleted]
        try:
            names = watch.changed()
            if names is None:
                self._look_at_all(connection, folder, deleted=deleted)
                return
            growing = "SELECT path FROM logs WHERE growing AND deleted = ?"
            stems = {stem for name in names if (stem := _stem(name)) is not None}
            stems |= {Path(row[0]).stem for row in connection.execute(growing, (int(deleted),)).fetchall()}
            for stem in stems:
                path = folder / f"{stem}{SUFFIX}"
                with suppress(FileNotFoundError):
                    self._look(connection, str(path.relative_to(self._directory)), _keys_of(path))
        except FileNotFoundError:
            watch.forget()
            for table in ("recordings", "logs"):
                connection.execute(f"DELETE FROM {table} WHERE deleted = ?", (int(deleted),))  # noqa: S608
            for table in ("joined", "jumps"):
                connection.execute(f"DELETE FROM {table} WHERE path NOT IN (SELECT path FROM logs)")  # noqa: S608
            raise
        except BaseException:
            watch.forget()  # what was told is not yet known
            raise

    def _look_at_all(self, connection: sqlite3.Connection, folder: Path, *, deleted: bool) -> None:
        """Compare all files of a folder with what is known of them."""
        with os.scandir(folder) as found:
            files = {each.name: each for each in found}
        below = "" if folder == self._directory else f"{folder.relative_to(self._directory)}/"
        asked = "SELECT path, keys FROM logs WHERE deleted = ?"
        known = dict(connection.execute(asked, (int(deleted),)).fetchall())
        changing = {row[0] for row in connection.execute("SELECT path FROM logs WHERE growing")}

        def key(name: str) -> FileKey | None:
            with suppress(OSError, KeyError):
                return file_key(files[name].stat(follow_symlinks=False))
            return None

        new: list[tuple[str, Keys]] = []
        for name in files:
            if name.endswith(SUFFIX) and is_recording_id(stem := name.removesuffix(SUFFIX)):
                keys: Keys = (key(name), *(key(f"{stem}{ending}") for ending in _ENDINGS))  # type: ignore[assignment]
                kept = known.pop(below + name, None)
                if kept is None or kept != wire.encode(keys) or below + name in changing:
                    new.append((below + name, keys))
        for start in range(0, len(new), _TOGETHER):
            connection.execute("BEGIN")
            try:
                for name, keys in new[start : start + _TOGETHER]:
                    if self._ending.is_set():
                        return
                    with suppress(FileNotFoundError):  # it has just been removed
                        self._look(connection, name, keys)
            finally:
                connection.execute("COMMIT")
        for name in known:
            self._forget(connection, name)

    def _look(self, connection: sqlite3.Connection, name: str, keys: Keys) -> Entry:
        """The entry of a file, read anew as far as it has changed.

        Args:
            connection: to the catalogue.
            name: of the file, with the folder in which it lies below the directory.
            keys: of the file and those beside it, as they are now.

        Raises:
            FileNotFoundError: the file is no longer there; then it is forgotten.
        """
        path, encoded = self._directory / name, wire.encode(keys)
        row = connection.execute("SELECT keys, plain, entry FROM logs WHERE path = ?", (name,)).fetchone()
        before: Keys = _KEYS.decode(row[0]) if row else (None, None, None, None)
        try:
            plain = _ENTRIES.decode(row[1]) if row and keys[0] is not None and before[0] == keys[0] else None
            if row and plain is None and self._still_growing(path, name, keys[0], before[0]):
                plain, keys = _ENTRIES.decode(row[1]), (before[0], *keys[1:])
                encoded = wire.encode(keys)
            if plain is None:
                plain = self._read(path, name)
        except FileNotFoundError:
            self._forget(connection, name)
            raise
        growing = plain.state is LogState.UNFINISHED
        if row and row[0] == encoded and not growing:
            known: Entry = _ENTRIES.decode(row[2])
            return known
        entry, deleted = plain, "/" in name
        if keys[1] is not None or deleted:
            entry = with_changes(plain, path, deleted=deleted)
        if growing and is_being_written(path):
            entry = replace(entry, state=LogState.WRITING)
        if row and row[0] == encoded and row[2] == wire.encode(entry):
            return entry
        jumps = None if row and before[2:] == keys[2:] else self._judge.jumps(path)
        self._keep(connection, name, encoded, plain, entry, jumps)
        return entry

    def _read(self, path: Path, name: str) -> Entry:
        began = time.monotonic()
        plain = read_entry(path)
        now = time.monotonic()
        if plain.state is LogState.UNFINISHED:
            self._fresh_until[name] = now + _PATIENCE * (now - began)
        else:
            self._fresh_until.pop(name, None)
        return plain

    def _still_growing(self, path: Path, name: str, key: FileKey | None, before: FileKey | None) -> bool:
        """Whether a log that is being written was read only just now."""
        if key is None or before is None or key[0] != before[0] or time.monotonic() > self._fresh_until.get(name, 0.0):
            return False
        try:
            with LogReader(path, skim=True, links=False) as reader:
                return not reader.closed
        except (OSError, BadInputError):
            return False  # then reading it anew says what is wrong

    def _keep(
        self,
        connection: sqlite3.Connection,
        name: str,
        keys: bytes,
        plain: Entry,
        entry: Entry,
        jumps: Iterable[FoundJump] | None,
    ) -> None:
        """Keep what was learned of a log; `jumps`: None if they are known."""
        with _at_once(connection):
            before = parts_with(connection, name)
            growing = int(plain.state is LogState.UNFINISHED)
            values = (name, int(entry.deleted), growing, keys, wire.encode(plain), wire.encode(entry))
            database.put(connection, "logs", values)
            for part in {*before, name}:
                put_recording(connection, part, self._level)
            if jumps is None:
                return
            connection.execute("DELETE FROM jumps WHERE path = ?", (name,))
            for found in jumps:
                figures = (getattr(found.jump, figure) for figure in database.FIGURES)
                database.put(
                    connection, "jumps",
                    (
                        name, found.jump.jump, int64(search.in_ns(found.jump.time.astimezone(UTC))), int(found.live),
                        int(found.jump.ok),
                        *(None if figure is None else float(figure.value) for figure in figures),
                        found.jump.model_dump_json().encode(),
                    ),
                )  # fmt: skip

    def _forget(self, connection: sqlite3.Connection, name: str) -> None:
        """Forget a log that is gone; what is left of its recording stays."""
        with _at_once(connection):
            left = {*parts_with(connection, name)} - {name}
            database.remove(connection, name)
            for part in left:
                put_recording(connection, part, self._level)

    def _level(self, entry: Entry) -> str:
        return self._judge.level(entry).value


@contextmanager
def _at_once(connection: sqlite3.Connection) -> Iterator[None]:
    """Have everything that is changed in the block kept, or nothing."""
    if connection.in_transaction:
        yield
        return
    connection.execute("BEGIN IMMEDIATE")
    try:
        yield
    except BaseException:
        connection.execute("ROLLBACK")
        raise
    connection.execute("COMMIT")


def _keys_of(path: Path) -> Keys:
    beside = [key_of(each(path)) for each in _BESIDE]
    return key_of(path), beside[0], beside[1], beside[2]


def _stem(name: str) -> str | None:
    """The id of the recording to which a file of this name belongs; None: to none."""
    for ending in (SUFFIX, *_ENDINGS):
        if name.endswith(ending) and is_recording_id(stem := name.removesuffix(ending)):
            return stem
    return None
