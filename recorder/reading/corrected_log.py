"""A log as a file in which the session is the corrected one: made while it is read, nothing is written.

Of the original only the session's metadata record is replaced. The padding behind the opening makes up for its other
length, so that chunks move by whole pages at most, usually not at all. Then the offsets in the summary are moved, and
the checksums of data section and summary follow from those of the original: no pixel is read for them. So a log that is
damaged is as damaged in its corrected form (decision 0033).
"""

import io
import os
import struct
from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from isal.isal_zlib import crc32
from mcap.opcode import Opcode
from mcap.records import Footer, Metadata

from recorder.log.crc import combined_crc
from recorder.log.index import footer
from recorder.log.mcap_layout import MAGIC, PADDING_OPCODE, PAGE, RECORD, padding, records
from recorder.reading.log_reader import UNREADABLE, stream
from recorder.reading.records import Damage, FileWindow, is_closed, walk
from rig.errors import BadInputError
from rig.host.files import open_regular
from rig.topics import SESSION_METADATA

if TYPE_CHECKING:
    from _typeshed import WriteableBuffer

_DATA_END: Final = RECORD.size + 4
_FOOTER: Final = RECORD.size + 8 + 8 + 4
#: Readers take no longer metadata record (`recorder.reading.records`).
_SESSION_MAX: Final = 128 << 10
_U64: Final = struct.Struct("<Q")
_U32: Final = struct.Struct("<I")
_BUFFER: Final = 256 << 10
#: Where a chunk index has the chunk's offset, the length of its table of message indexes, and the table, in which each
#: row is a channel and an offset.
_CHUNK_OFFSET, _TABLE_LENGTH, _TABLE = RECORD.size + 16, RECORD.size + 32, RECORD.size + 36
_CHANNEL, _ROW = 2, 10


@dataclass(frozen=True, slots=True)
class Piece:
    """A stretch of the corrected file.

    Attributes:
        begin: where it begins in it.
        length: bytes.
        source: where it begins in the original; of no meaning if it has bytes of its own.
        data: its bytes, None if they are the original's.
    """

    begin: int
    length: int
    source: int
    data: bytes | None = None


@dataclass(frozen=True, slots=True)
class CorrectedLog:
    """What a corrected log consists of.

    Attributes:
        path: the original.
        status: of the original when it was looked at.
        size: bytes of the corrected log.
        pieces: from its begin to its end.
        corrected: it differs from the original.
    """

    path: Path
    status: os.stat_result
    size: int
    pieces: tuple[Piece, ...]
    corrected: bool

    def open(self) -> io.BufferedReader:
        """The corrected log, open for reading; close it.

        Raises:
            BadInputError: the original is another file by now.
            OSError: it is no longer there, or may not be read.
        """
        return io.BufferedReader(_CorrectedFile(self), _BUFFER)


def corrected_log(path: Path, changes: Mapping[str, str]) -> CorrectedLog:
    """A log with changed session fields.

    Args:
        path: the log; nobody writes it any more.
        changes: the session fields that were changed after the recording.

    Returns:
        The corrected log. It is the original as it stands if there are no changes, and also if its session record
        cannot be found or replaced: it is damaged there, or was not written by svev.

    Raises:
        BadInputError: the log cannot be read, or is no regular file.
    """
    window = FileWindow(path, direct=False, links=False)
    try:
        found = _find(window) if changes else None
        pieces = None if found is None else _Correction(window, found, changes).pieces()
    except UNREADABLE:
        pieces = None
    finally:
        window.close()
    if pieces is None:
        return CorrectedLog(path, window.status, window.size, (Piece(0, window.size, 0),), corrected=False)
    return CorrectedLog(path, window.status, pieces[-1].begin + pieces[-1].length, pieces, corrected=True)


@dataclass(frozen=True, slots=True)
class _Session:
    """The session's record, and the padding behind the opening that it stands in.

    Attributes:
        offset, length: of the record.
        fields: what it says.
        padding: offset and length of the padding; length 0 where the first chunk begins without any.
    """

    offset: int
    length: int
    fields: dict[str, str]
    padding: tuple[int, int]


def _find(window: FileWindow) -> _Session | None:
    """The session's record; None if there is none in the opening of the log, or several."""
    if bytes(window.read(0, len(MAGIC))) != MAGIC:
        return None
    found: tuple[int, int, dict[str, str]] | None = None
    for record in walk(window, len(MAGIC), window.size):
        if isinstance(record, Damage) or record.opcode in (Opcode.DATA_END, Opcode.FOOTER):
            return None
        if found and record.opcode in (PADDING_OPCODE, Opcode.CHUNK):
            length = record.length if record.opcode == PADDING_OPCODE else 0
            return _Session(*found, (record.offset, length))
        if record.opcode == Opcode.CHUNK:
            return None
        if record.opcode == Opcode.METADATA:
            body = bytes(window.read(record.offset + RECORD.size, record.length - RECORD.size))
            metadata = Metadata.read(stream(body))
            if metadata.name == SESSION_METADATA:
                if found:
                    return None
                found = record.offset, record.length, metadata.metadata
    return None


class _Correction:
    """Makes the pieces of one corrected log."""

    def __init__(self, window: FileWindow, session: _Session, changes: Mapping[str, str]) -> None:
        self._window, self._session = window, session
        self._record = records(Metadata(SESSION_METADATA, {**session.fields, **changes}))
        before, self._rest = session.padding[1], sum(session.padding)
        self._grown = len(self._record) - session.length
        least = RECORD.size
        filling = least + (before - self._grown - least) % PAGE if before else 0
        self._shift = self._grown + filling - before
        opening = bytearray(window.read(0, self._rest))
        opening[session.padding[0] :] = padding(filling) if before else b""
        opening[session.offset : session.offset + session.length] = self._record
        self._opening = bytes(opening)

    def pieces(self) -> tuple[Piece, ...] | None:
        """From begin to end; None if the session cannot be replaced in this log."""
        if len(self._record) > _SESSION_MAX:
            return None
        window, start = self._window, len(self._opening)
        opening = Piece(0, start, 0, self._opening)
        if not is_closed(window):
            return opening, Piece(start, window.size - self._rest, self._rest)
        closing_begin, closing = self._closing()
        if closing is None:
            return None
        between = closing_begin - self._rest
        return opening, Piece(start, between, self._rest), Piece(start + between, len(closing), 0, closing)

    def _closing(self) -> tuple[int, bytes | None]:
        """Where the original's end begins, and what stands from there on in the corrected log."""
        window = self._window
        tail = bytes(window.read(window.size - _FOOTER - len(MAGIC), _FOOTER))
        foot = Footer.read(stream(tail[RECORD.size :]))
        begin = foot.summary_start - _DATA_END
        if begin < self._rest or foot.summary_offset_start < foot.summary_start:
            return 0, None
        ending = bytearray(window.read(begin, window.size - len(MAGIC) - begin))
        summary = slice(_DATA_END, len(ending) - _FOOTER)
        if ending[0] != Opcode.DATA_END or (foot.summary_crc and not self._summary_sound(ending, foot.summary_crc)):
            return 0, None
        self._correct_data_crc(ending, begin - self._rest)
        if self._move(ending, summary) != 1:  # another session record stands elsewhere
            return 0, None
        starts = foot.summary_start + self._shift, foot.summary_offset_start + self._shift
        end = footer(bytes(ending[summary]), *starts)
        if not foot.summary_crc:
            end = records(Footer(*starts, 0))
        return begin, bytes(ending[: summary.stop]) + end + MAGIC

    @staticmethod
    def _summary_sound(ending: bytearray, crc: int) -> bool:
        return crc32(memoryview(ending)[_DATA_END:-4]) == crc

    def _correct_data_crc(self, ending: bytearray, rest: int) -> None:
        """Exchange the opening in the checksum of the data section, which has `rest` bytes behind the opening."""
        (crc,) = _U32.unpack_from(ending, RECORD.size)
        if crc:
            before = crc32(self._window.read(0, self._rest))
            behind = crc ^ combined_crc(before, 0, rest)
            _U32.pack_into(ending, RECORD.size, combined_crc(crc32(self._opening), behind, rest))

    def _move(self, ending: bytearray, summary: slice) -> int:
        """Move all offsets in the summary.

        Returns:
            How many session records it lists.
        """
        place, sessions = summary.start, 0
        while place < summary.stop:
            opcode, length = RECORD.unpack_from(ending, place)
            match opcode:
                case Opcode.CHUNK_INDEX if self._shift:
                    (table,) = _U32.unpack_from(ending, place + _TABLE_LENGTH)
                    if table > length:
                        raise ValueError("a chunk index is shorter than its table")
                    rows = range(place + _TABLE + _CHANNEL, place + _TABLE + table, _ROW)
                    for each in (place + _CHUNK_OFFSET, *rows):
                        self._move_one(ending, each)
                case Opcode.METADATA_INDEX | Opcode.ATTACHMENT_INDEX:
                    if self._move_one(ending, place + RECORD.size) == self._session.offset:
                        sessions += 1
                        _U64.pack_into(ending, place + RECORD.size + 8, len(self._record))
                    elif (
                        opcode == Opcode.METADATA_INDEX and SESSION_METADATA.encode() in ending[place : place + length]
                    ):
                        sessions += 1
                case Opcode.SUMMARY_OFFSET:
                    self._move_one(ending, place + RECORD.size + 1)
            place += RECORD.size + length
        return sessions

    def _move_one(self, ending: bytearray, place: int) -> int:
        """Move the offset that stands at `place`.

        Returns:
            What it was.
        """
        (offset,) = _U64.unpack_from(ending, place)
        if offset >= self._rest:
            _U64.pack_into(ending, place, offset + self._shift)
        elif offset > self._session.offset:
            _U64.pack_into(ending, place, offset + self._grown)
        return int(offset)


def _identity(status: os.stat_result) -> tuple[int, ...]:
    """What tells a file from another one that got its name, and from itself when somebody has written into it."""
    return status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns


class _CorrectedFile(io.RawIOBase):
    """A corrected log, open for reading."""

    def __init__(self, log: CorrectedLog) -> None:
        super().__init__()
        self._log = log
        self._begins = [piece.begin for piece in log.pieces]
        self._place = 0
        self._fd = open_regular(log.path, links=False)
        if _identity(os.fstat(self._fd)) != _identity(log.status):
            self.close()
            raise BadInputError(f"{log.path}: is another file than before: load the page again")

    def readable(self) -> bool:
        """It is."""
        return True

    def seekable(self) -> bool:
        """It is."""
        return True

    def tell(self) -> int:
        """The present place."""
        return self._place

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Go to a place."""
        self._place = offset + {os.SEEK_SET: 0, os.SEEK_CUR: self._place, os.SEEK_END: self._log.size}[whence]
        return self._place

    def readinto(self, buffer: "WriteableBuffer") -> int:
        """Fill a buffer as far as the present piece goes.

        Raises:
            BadInputError: the original has become shorter.
        """
        view = memoryview(buffer).cast("B")
        if self._place >= self._log.size or not view:
            return 0
        piece = self._log.pieces[bisect_right(self._begins, self._place) - 1]
        inside = self._place - piece.begin
        view = view[: piece.length - inside]
        if piece.data is not None:
            view[:] = piece.data[inside : inside + len(view)]
            got = len(view)
        else:
            got = os.preadv(self._fd, [view], piece.source + inside)
            if got == 0:
                raise BadInputError(f"{self._log.path}: has become shorter while it was read; download it again")
        self._place += got
        return got

    def close(self) -> None:
        """Close it; a second call does nothing."""
        if not self.closed:
            os.close(self._fd)
        super().close()
