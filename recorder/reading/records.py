"""Finds the records in a log's file in any state: with a torn end, garbage in the middle or absurd lengths.

One reusable window reads the file: it takes no more memory than the longest record, and long reads go past the page
cache.
"""

import errno
import mmap
import os
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap.opcode import Opcode

from recorder.log.mcap_layout import MAGIC, MESSAGE, PADDING_OPCODE, PAGE, RECORD, round_up
from rig.disk import set_direct
from rig.errors import BadInputError

#: The window reads so much more than it was asked for, so that it holds the head of the next record too.
_READ_ON = 4 * PAGE
#: Start and end time, size of the records, their CRC, length of the compression's name (which follows).
CHUNK_HEAD = struct.Struct("<QQQII")
#: A record that claims to be longer than this is none of ours.
_CHUNK_MAX, _SMALL_MAX, _PADDING_MAX = 1 << 30, 64 << 20, 8 * PAGE
#: After damage, pages are searched in pieces of so many bytes for one of the records with which a write begins.
_SEARCH_BYTES = 256 * PAGE
_WRITE_BEGINS = (PADDING_OPCODE, Opcode.CHUNK, Opcode.DATA_END)


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


class FileWindow:
    """Random access to a file.

    Attributes:
        path: the file.
        size: its size when it was opened, in bytes.
    """

    def __init__(self, path: Path, *, direct: bool) -> None:
        """Open the file.

        Args:
            path: the file.
            direct: read past the page cache where the file system can; this is cheaper for long reads in order.

        Raises:
            BadInputError: the file is missing, may not be read, or is not a regular file.
        """
        try:
            self._fd = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)
        except FileNotFoundError:
            raise BadInputError(f"{path}: no such file; name an existing log") from None
        except OSError as error:
            raise BadInputError(f"{path}: cannot be read ({error.strerror}); check its permissions") from None
        if not os.path.isfile(self._fd):  # noqa: PTH113  # asks about the open file, not about its name
            os.close(self._fd)
            raise BadInputError(f"{path}: is no file; name a log")
        self.path = path
        self.size = os.fstat(self._fd).st_size
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


def walk(window: FileWindow) -> Iterator[RawRecord | Damage]:
    """All records from the one after the magic bytes to the footer, and the damage between readable parts."""
    offset = len(MAGIC)
    while offset < window.size:
        record = _record_at(window, offset)
        if record is None:
            found = _next_readable(window, offset)
            end = window.size if found is None else found
            text = "the file ends in the middle of a record" if found is None else "unreadable"
            yield Damage(offset, end - offset, text, torn=found is None)
            offset = end
            continue
        yield record
        offset += record.length
        if record.opcode == Opcode.FOOTER:
            if bytes(window.read(offset, len(MAGIC) + 1)) != MAGIC:
                yield Damage(offset, window.size - offset, "the file does not end as an MCAP log ends")
            return


def is_closed(window: FileWindow) -> bool:
    """Whether the file ends in a footer: the log was closed."""
    footer_bytes = RECORD.size + 8 + 8 + 4
    end = window.read(max(0, window.size - footer_bytes - len(MAGIC)), footer_bytes + len(MAGIC))
    return len(end) == footer_bytes + len(MAGIC) and end[0] == Opcode.FOOTER and bytes(end[footer_bytes:]) == MAGIC


def _record_at(window: FileWindow, offset: int) -> RawRecord | None:
    """The record at `offset`, None if its opcode or length is impossible or the file ends before it does."""
    head = window.read(offset, RECORD.size)
    if len(head) < RECORD.size:
        return None
    opcode, content = RECORD.unpack(head)
    if offset + RECORD.size + content > window.size:
        return None
    match opcode:
        case Opcode.CHUNK:
            plausible = _is_chunk(window, offset + RECORD.size, content)
        case Opcode.FOOTER:
            plausible = content == 8 + 8 + 4
        case Opcode.DATA_END:
            plausible = content == 4
        case _ if opcode == PADDING_OPCODE:
            plausible = content <= _PADDING_MAX
        case _:
            plausible = Opcode.HEADER <= opcode <= Opcode.DATA_END and content <= _SMALL_MAX
    return RawRecord(opcode, offset, RECORD.size + content) if plausible else None


def _is_chunk(window: FileWindow, offset: int, content: int) -> bool:
    """Whether the lengths in a chunk's head agree with the length of its record."""
    if not CHUNK_HEAD.size + 8 <= content <= _CHUNK_MAX:
        return False
    _, _, size, _, name_bytes = CHUNK_HEAD.unpack(window.read(offset, CHUNK_HEAD.size))
    before = CHUNK_HEAD.size + name_bytes + 8
    if before > content or size > _CHUNK_MAX:
        return False
    (stored,) = struct.unpack("<Q", window.read(offset + before - 8, 8))
    return bool(stored == content - before and (name_bytes or stored == size))


def _next_readable(window: FileWindow, offset: int) -> int | None:
    """The next page after `offset` with which a write of ours begins; None if there is none up to the end."""
    page = offset - offset % PAGE + PAGE
    while page < window.size:
        starts = np.frombuffer(window.read(page, _SEARCH_BYTES), np.uint8)[::PAGE]
        for candidate in np.flatnonzero(np.isin(starts, _WRITE_BEGINS)):
            position = page + int(candidate) * PAGE
            if _begins_readable(window, position):
                return position
        page += _SEARCH_BYTES
    return None


def _begins_readable(window: FileWindow, offset: int) -> bool:
    """Whether a chunk with a message, or the end of the data, stands at `offset` or after padding there."""
    record = _record_at(window, offset)
    if record is not None and record.opcode == PADDING_OPCODE:
        record = _record_at(window, offset + record.length)
    if record is None:
        return False
    if record.opcode == Opcode.DATA_END:
        return True
    inner = window.read(record.offset + RECORD.size + CHUNK_HEAD.size + 8, RECORD.size)
    return record.opcode == Opcode.CHUNK and inner[0] == Opcode.MESSAGE and record.length > MESSAGE.size
