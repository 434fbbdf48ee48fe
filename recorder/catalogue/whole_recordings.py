"""The rows of recordings in the catalogue's file, each made of the rows of all logs into which a recording is split."""

import sqlite3
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Final

from recorder.catalogue import database
from recorder.catalogue.entry import Entry, joined
from recorder.log.extent import CONTINUES, CONTINUES_AFTER, PART, part_number
from recorder.reading.parts import parts_of
from rig.api.athletes import folded
from rig.phrase import escaped
from rig.transport import wire

_INT64_MAX: Final = (1 << 63) - 1
_LONGEST_SEARCHED: Final = 20_000
#: Session fields that no person has written.
_UNSEARCHED: Final = frozenset({"session", "recording", CONTINUES, CONTINUES_AFTER, PART, "favourite"})
#: Session fields that a list of jumps shows.
_SHOWN: Final = ("athlete", "bib", "gate")
_ENTRIES: Final = wire.decoder(Entry)


def parts_with(connection: sqlite3.Connection, path: str) -> tuple[str, ...]:
    """Paths of the logs that are one recording with this one, by what the catalogue knows; itself among them.

    A log that is nobody's next part, such as a copy of one, is a recording of its own.
    """

    def session(log: Path) -> Mapping[str, str] | None:
        row = connection.execute("SELECT plain FROM logs WHERE path = ?", (str(log),)).fetchone()
        if row is None:
            return None
        entry: Entry = _ENTRIES.decode(row[0])
        return entry.session

    log = Path(path)
    found = parts_of(log, session)
    if log not in (whole := parts_of(found[0], session)):
        whole = found[found.index(log) :]
    return tuple(map(str, whole))


def entries_of(connection: sqlite3.Connection, paths: Sequence[str]) -> list[Entry]:
    """The entries of recordings, by the paths of their first logs, in the order of these; one query for all."""
    asked = (
        "SELECT l.path, coalesce(j.entry, l.entry) FROM logs l LEFT JOIN joined j ON j.path = l.path "
        "WHERE l.path IN (SELECT value FROM json_each(?))"
    )
    found = dict(connection.execute(asked, (wire.encode(paths).decode(),)).fetchall())
    return [_ENTRIES.decode(found[path]) for path in paths]


def put_recording(connection: sqlite3.Connection, path: str, level: Callable[[Entry], str]) -> None:
    """Write the row of the recording to which a log belongs, and none for its later parts.

    Args:
        connection: to the catalogue.
        path: of the log.
        level: tells how grave the verdict on a recording is.
    """
    parts = parts_with(connection, path)
    asked = "SELECT entry FROM logs WHERE path = ?"
    entry = joined([_ENTRIES.decode(connection.execute(asked, (part,)).fetchone()[0]) for part in parts])
    for part in parts[1:]:
        connection.execute("DELETE FROM recordings WHERE path = ?", (part,))
    for part in parts:
        connection.execute("DELETE FROM joined WHERE path = ?", (part,))
    if len(parts) > 1:
        database.put(connection, "joined", (parts[0], wire.encode(entry)))
    session = {field: escaped(text) for field, text in entry.session.items()}
    said = "\n".join((entry.id, *(text for field, text in session.items() if field not in _UNSEARCHED)))
    bib = folded(session.get("bib", ""))
    database.put(
        connection, "recordings",
        (
            parts[0], entry.id, int(entry.deleted), int64(entry.time), float(entry.duration_s), level(entry),
            folded(session.get("athlete", "")), bib,
            int(bib) if bib.isascii() and bib.isdecimal() and len(bib) < 19 else None, int(entry.favourite),
            "\n".join(("", *(folded(tag) for tag in entry.tags), "")),
            session.get(CONTINUES, ""), escaped(entry.next_part),
            part_number(session), folded(session.get("hill", "") or escaped(entry.rig)),
            folded(said[:_LONGEST_SEARCHED]),
            wire.encode({folded(field): folded(text) for field, text in session.items()}).decode(),
            wire.encode({field: session.get(field, "") for field in _SHOWN}).decode(),
        ),
    )  # fmt: skip


def int64(value: int) -> int:
    """The nearest number that a column holds."""
    return max(-_INT64_MAX, min(_INT64_MAX, value))
