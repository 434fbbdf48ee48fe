"""Reads a recording that is split into several logs as if it were one."""

import os
from bisect import bisect_right
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from itertools import accumulate
from pathlib import Path

from recorder.log.beside import named, numbered
from recorder.log.extent import CONTINUES, part_after, part_before, part_number
from recorder.reading.items import Chunk, Item
from recorder.reading.log_reader import LogReader
from rig.errors import BadInputError
from rig.topics import RECORDING_METADATA, SESSION_METADATA


def parts_of(log: Path, session: Callable[[Path], Mapping[str, str] | None] | None = None) -> tuple[Path, ...]:
    """All logs of a split recording that lie beside each other, in order; of another recording its one log.

    Args:
        log: any of them. None of those before or after a missing one is found.
        session: gives the session fields that a log begins with, None if there is no such file; None: they are read.
    """
    told = session or _session
    first, number = numbered(log)
    if number == 1 and told(named(first, 2, log)) is None:
        return (log,)
    found = [log]
    while (before := _before(found[0], told)) is not None:
        found.insert(0, before)
    while (after := _after(found[-1], told)) is not None:
        found.append(after)
    return tuple(found)


def missing_before(metadata: Mapping[str, Mapping[str, str]], log: Path) -> str:
    """Id of the log that this one continues, if it lies beside it neither as it was recorded nor renamed alike."""
    said = part_before(metadata, log)
    return "" if said and _before(log, _session) is not None else said


def missing_after(metadata: Mapping[str, Mapping[str, str]], log: Path) -> str:
    """The same of the log in which this one goes on."""
    said = part_after(metadata, log)
    return "" if said and _after(log, _session) is not None else said


def _before(log: Path, told: Callable[[Path], Mapping[str, str] | None]) -> Path | None:
    """The part before a log, None if it is not there."""
    session = told(log) or {}
    if (number := part_number(session)) == 1:
        return None
    said = log.with_name(f"{Path(session[CONTINUES]).name}{log.suffix}")
    for path in (said, named(numbered(log)[0], number - 1, log)):  # they may all have been renamed
        other = told(path)
        if other is not None and path != log and _same(session, other) and part_number(other) < number:
            return path
    return None


def _after(log: Path, told: Callable[[Path], Mapping[str, str] | None]) -> Path | None:
    """The part after a log, None if it is not there."""
    session = told(log) or {}
    first, number = numbered(log)
    while (other := told(path := named(first, number + 1, log))) is not None:
        if _same(session, other) and part_number(other) > part_number(session):
            return path
        number += 1  # another recording had this name when the part was made
    return None


def _same(one: Mapping[str, str], other: Mapping[str, str]) -> bool:
    return one.get("recording", "") == other.get("recording", "") != ""


def _session(log: Path) -> Mapping[str, str] | None:
    """The session fields that a log begins with, none if it cannot be read; None: there is no such file."""
    if not os.path.lexists(log):
        return None
    with suppress(BadInputError, OSError), LogReader(log, skim=True, links=False) as reader:
        next((item for item in reader.items(only=()) if isinstance(item, Chunk) or _told(reader)), None)
        return reader.metadata.get(SESSION_METADATA, {})
    return {}


def _told(reader: LogReader) -> bool:
    return SESSION_METADATA in reader.metadata


class RecordingReader(LogReader):
    """All parts of a split recording, open for reading as one log: any part of it may be named.

    Offsets are those of the parts laid end to end. Session and attachments are those of the first part, what is said of
    the recording's end that of the last one.

    Attributes:
        paths: the parts, in order.
    """

    def __init__(self, path: Path, *, skim: bool = False, links: bool = True) -> None:
        """Open the first part.

        Args:
            path: any of the parts, or the only log of a recording.
            skim: the caller will read only small parts of it.
            links: whether a link of this name is followed.

        Raises:
            BadInputError: as for one log, also of a later part.
        """
        self.paths = parts_of(path)
        self._how = {"skim": skim, "links": links}
        self._place = 0
        self._part: LogReader | None = None
        super().__init__(self.paths[0], **self._how)
        self._sizes = [self.size]
        try:
            for place in range(1, len(self.paths)):
                part = self._at(place)
                self._sizes.append(part.size)
                self.closed, self.status = self.closed and part.closed, part.status
        except BaseException:
            self.close()
            raise
        self._begins = [0, *accumulate(self._sizes)]
        self.size = self._begins[-1]

    def items(self, only: Collection[str] | None = None) -> Iterator[Item]:
        """Everything in the parts but padding, in their order."""
        if len(self.paths) == 1:
            yield from super().items(only)
            return
        first: Mapping[str, dict[str, str]] = {}
        for place, begin in enumerate(self._begins[:-1]):
            with LogReader(self.paths[place], **self._how) as part:
                for item in part.items(only):
                    self._learn(part, first)
                    yield _moved(item, begin)
                self._learn(part, first)
            first = first or dict(self.metadata)

    def chunk(self, offset: int, length: int) -> Chunk:
        """A chunk that `items` has handed out, with all its data, and checked."""
        if len(self.paths) == 1:
            return super().chunk(offset, length)
        place = bisect_right(self._begins, offset, hi=len(self.paths)) - 1
        found = _moved(self._at(place).chunk(offset - self._begins[place], length), self._begins[place])
        if not isinstance(found, Chunk):
            raise TypeError("a chunk was asked for")
        return found

    def close(self) -> None:
        """Close the files; a second call does nothing."""
        super().close()
        if self._part is not None:
            self._part.close()

    def _at(self, place: int) -> LogReader:
        """One of the parts; one is open at a time."""
        if self._part is None or self._place != place:
            if self._part is not None:
                self._part.close()
            self._part, self._place = LogReader(self.paths[place], **self._how), place
        return self._part

    def _learn(self, part: LogReader, first: Mapping[str, dict[str, str]]) -> None:
        """Take over what a part has said until now, behind what the first part has said."""
        self.truncated = self.truncated or part.truncated
        self.has_camera_topics = self.has_camera_topics or part.has_camera_topics
        for name, data in part.attachments.items():
            self.attachments.setdefault(name, data)
        for name, fields in part.metadata.items():
            if name == RECORDING_METADATA:
                begin = first.get(name, {}).get("begin_ns")
                self.metadata[name] = fields if begin is None else fields | {"begin_ns": begin}
            elif name == SESSION_METADATA:
                self.metadata.setdefault(name, fields)
            else:
                self.metadata[name] = fields


def _moved(item: Item, by: int) -> Item:
    """An item of a part, where it stands in the whole."""
    if not by:
        return item
    if not isinstance(item, Chunk):
        return replace(item, offset=item.offset + by)
    messages = tuple(replace(message, offset=message.offset + by) for message in item.messages)
    return replace(item, offset=item.offset + by, messages=messages)
