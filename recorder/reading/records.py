"""Finds the records in a log's file in any state: with a torn end, garbage in the middle or absurd lengths.

One reusable window reads the file: it takes no more memory than the longest record, and long reads go past the page
cache.
"""

import errno
import mmap
import os
import re
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from mcap.opcode import Opcode

from recorder.log.mcap_layout import CHUNK_MAX, MAGIC, PADDING_OPCODE, PAGE, RECORD, round_up
from rig.errors import BadInputError
from rig.host.disk import set_direct
from rig.host.files import UntrustedFileError, open_regular

#: The window reads so much more than it was asked for, so that it holds the head of the next record too.
_READ_ON = 4 * PAGE
#: Start and end time, size of the records, their CRC, length of the compression's name (which follows).
CHUNK_HEAD = struct.Struct("<QQQII")
#: A record that claims to be longer than this is none of ours: by its kind, all others.
_LONGEST: dict[int, int] = {
    Opcode.CHUNK: CHUNK_MAX,
    Opcode.ATTACHMENT: 64 << 20,
    Opcode.MESSAGE: 16 << 20,
    Opcode.MESSAGE_INDEX: 2 << 20,
    PADDING_OPCODE: 8 * PAGE,
}
_LONGEST_OTHER = 128 << 10
#: How the records begin with which reading goes on after damage: a chunk (its lengths are looked at closely
#: afterwards), our metadata, our attachments, the end of the data. A match is one byte: another may begin behind it.
_CHUNK_BEGINS = re.compile(rb"\x06(?=.{4}\0{4}.{16}.{4}\0{4}.{4}\0{4}.{4}\0{4})", re.DOTALL)
_OTHERS_BEGIN = (
    re.compile(rb"\x0c(?=.{4}\0{4}.\0{3}svev\.)", re.DOTALL),
    re.compile(rb"\x09(?=.{4}\0{4}.{16}.\0{3}(?:rig\.toml|calibration\.json))", re.DOTALL),
    re.compile(rb"\x0f(?=\x04\0{7})"),
)
_BEGINNING_MAX = 64
#: They are searched for in pieces of so many bytes: first in what the window holds already.
_FIRST_PIECE, _LONGEST_PIECE = _READ_ON, 4 << 20


@dataclass(frozen=True, slots=True)
class RawRecord:
    """Where a record stands in the file: from `offset` on, `length` bytes, its opcode and length field included."""

    opcode: int
    offset: int
    length: int


@dataclass(frozen=True, slots=True)
class Damage:
    """Bytes of the file that are not a readable record.

    Attributes:
        offset: where they start.
        length: how many they are.
        text: what is wrong.
        torn: the file ends in the middle of a record there, as after a crash.
    """

    offset: int
    length: int
    text: str
    torn: bool = False


def link_text(path: Path) -> str:
    """What is wrong with a link under the name of a log."""
    return f"{path}: is a link, and links are not followed; put the log itself here, or remove the link"


class FileWindow:
    """Random access to a file.

    Attributes:
        path: the file.
        status: of the file when it was opened.
        size: its size then, in bytes.
    """

    def __init__(self, path: Path, *, direct: bool, links: bool = True) -> None:
        """Open the file.

        Args:
            path: the file.
            direct: read past the page cache where the file system can; this is cheaper for long reads in order.
            links: whether a link of this name is followed; not in a folder of recordings.

        Raises:
            BadInputError: the file is missing, may not be read, or is not a regular file.
        """
        try:
            self._fd = open_regular(path, links=links)
        except FileNotFoundError:
            raise BadInputError(f"{path}: no such file; name an existing log") from None
        except UntrustedFileError as error:
            text = link_text(path) if error.errno == errno.ELOOP else f"{path}: is no file; name a log"
            raise BadInputError(text) from None
        except OSError as error:
            raise BadInputError(f"{path}: cannot be read ({error.strerror}); check its permissions") from None
        self.path = path
        self.status = os.fstat(self._fd)
        self.size = self.status.st_size
        self._begin = self._end = 0
        self._buffer = self._allocate(_READ_ON)
        if direct:
            set_direct(self._fd, wanted=True)

    def read(self, offset: int, length: int) -> memoryview:
        """The bytes from `offset` on, fewer than `length` only at the end of the file; valid until the next `read`.

        Raises:
            BadInputError: the disk cannot read them.
        """
        if offset < self._begin or offset + length > self._end:
            self._fill(offset, length)
        first = offset - self._begin
        return self._view[first : max(first, min(first + length, self._end - self._begin))]

    def has_grown(self) -> bool:
        """Whether the file is longer now than when it was opened."""
        return os.fstat(self._fd).st_size > self.size

    def data_from(self, offset: int) -> int:
        """The first byte from `offset` on that is not in a hole of the file; the size of the file if there is none."""
        try:
            return max(offset, os.lseek(self._fd, offset, os.SEEK_DATA))
        except OSError as error:
            return self.size if error.errno == errno.ENXIO else offset

    def close(self) -> None:
        """Close the file; a second call does nothing."""
        if self._fd >= 0:
            os.close(self._fd)
            self._fd = -1

    def _fill(self, offset: int, length: int) -> None:
        begin = offset - offset % PAGE
        wanted = round_up(offset + length + _READ_ON - begin)
        if wanted > len(self._buffer):
            self._buffer = self._allocate(wanted)
        self._begin = self._end = begin
        while self._end - begin < wanted:
            got = self._read_into(self._view[self._end - begin : wanted], self._end)
            self._end += got
            if got == 0 or got % PAGE:
                break

    def _read_into(self, view: memoryview, offset: int) -> int:
        try:
            return os.preadv(self._fd, [view], offset)
        except OSError as error:
            if error.errno == errno.EINVAL:  # some file systems accept direct I/O and then refuse it
                set_direct(self._fd, wanted=False)
                try:
                    return os.preadv(self._fd, [view], offset)
                except OSError as second:
                    error = second
            raise BadInputError(
                f"{self.path}: cannot be read at byte {offset} ({error.strerror}); look at `dmesg`"
            ) from error

    def _allocate(self, size: int) -> mmap.mmap:
        buffer = mmap.mmap(-1, size, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
        if hasattr(mmap, "MADV_HUGEPAGE"):
            buffer.madvise(mmap.MADV_HUGEPAGE)
        self._view = memoryview(buffer)
        return buffer


def walk(window: FileWindow, begin: int, end: int) -> Iterator[RawRecord | Damage]:
    """All records between two places of the file, and the damage between readable parts; at most to the footer."""
    offset = begin
    while offset < end:
        record = record_at(window, offset, end)
        if record is None:
            found = next(_beginnings(window, offset + 1, end, (_CHUNK_BEGINS, *_OTHERS_BEGIN)), None)
            until = end if found is None else found.offset
            torn = found is None and end == window.size
            text = "the file ends in the middle of a record" if torn else "unreadable"
            yield Damage(offset, until - offset, text, torn)
            offset = until
            continue
        yield record
        offset += record.length
        if record.opcode == Opcode.FOOTER:
            if bytes(window.read(offset, len(MAGIC) + 1)) != MAGIC:
                yield Damage(offset, window.size - offset, "the file does not end as an MCAP log ends")
            return


def chunks_anywhere(window: FileWindow, begin: int) -> Iterator[RawRecord]:
    """Everything from `begin` on that looks like a chunk, at any offset, also inside of others."""
    return _beginnings(window, begin, window.size, (_CHUNK_BEGINS,))


def is_closed(window: FileWindow) -> bool:
    """Whether the file ends in a footer: the log was closed."""
    footer_bytes = RECORD.size + 8 + 8 + 4
    end = window.read(max(0, window.size - footer_bytes - len(MAGIC)), footer_bytes + len(MAGIC))
    return len(end) == footer_bytes + len(MAGIC) and end[0] == Opcode.FOOTER and bytes(end[footer_bytes:]) == MAGIC


def record_at(window: FileWindow, offset: int, end: int) -> RawRecord | None:
    """The record at `offset`, None if its opcode or length is impossible or it does not end before `end`."""
    head = window.read(offset, RECORD.size)
    if len(head) < RECORD.size:
        return None
    opcode, content = RECORD.unpack(head)
    if offset + RECORD.size + content > end or content > _LONGEST.get(opcode, _LONGEST_OTHER):
        return None
    match opcode:
        case Opcode.CHUNK:
            plausible = _is_chunk(window, offset + RECORD.size, content)
        case Opcode.FOOTER:
            plausible = content == 8 + 8 + 4
        case Opcode.DATA_END:
            plausible = content == 4
        case Opcode.MESSAGE_INDEX:  # channel and length of what follows
            plausible = content >= 6 and struct.unpack("<I", window.read(offset + RECORD.size + 2, 4))[0] == content - 6
        case _:
            plausible = Opcode.HEADER <= opcode <= Opcode.DATA_END or opcode == PADDING_OPCODE
    return RawRecord(opcode, offset, RECORD.size + content) if plausible else None


def _is_chunk(window: FileWindow, offset: int, content: int) -> bool:
    """Whether the lengths in a chunk's head agree with the length of its record."""
    if content < CHUNK_HEAD.size + 8:
        return False
    _, _, size, _, name_bytes = CHUNK_HEAD.unpack(window.read(offset, CHUNK_HEAD.size))
    before = CHUNK_HEAD.size + name_bytes + 8
    if before > content or size > CHUNK_MAX:
        return False
    (stored,) = struct.unpack("<Q", window.read(offset + before - 8, 8))
    return bool(stored == content - before and (name_bytes or stored == size))


def _beginnings(window: FileWindow, begin: int, end: int, patterns: Sequence[re.Pattern[bytes]]) -> Iterator[RawRecord]:
    """The records between two places of the file that begin like one of the patterns, in their order, at any offset."""
    length = _FIRST_PIECE - _BEGINNING_MAX
    while (begin := window.data_from(begin)) < end:
        piece = bytes(window.read(begin, min(length + _BEGINNING_MAX, end - begin)))
        places = {match.start() for pattern in patterns for match in pattern.finditer(piece)}
        for place in sorted(places):
            if place < length and (record := record_at(window, begin + place, end)) is not None:
                yield record
        begin += length
        length = min(4 * length, _LONGEST_PIECE)
