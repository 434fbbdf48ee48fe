"""Walks over the records of a log, whatever state it is in: torn end, garbage in the middle, absurd lengths."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from mcap.opcode import Opcode

from recorder.file_window import FileWindow
from recorder.log_items import Damage
from recorder.mcap_layout import MAGIC, MESSAGE, PADDING_OPCODE, PAGE, RECORD

#: Start and end time, size of the records, their CRC, length of the compression's name (which follows).
CHUNK_HEAD = struct.Struct("<QQQII")
CHUNK_MAX = 1 << 30
_SMALL_MAX = 64 << 20
_PADDING_MAX = 8 * PAGE
_SEARCH_BYTES = 256 * PAGE
_PAGE_STARTS = (PADDING_OPCODE, Opcode.CHUNK, Opcode.DATA_END)


@dataclass(frozen=True, slots=True)
class RawRecord:
    """A record that stands in the file from `offset` on; `length` counts opcode and length field too."""

    opcode: int
    offset: int
    length: int


def walk(window: FileWindow) -> Iterator[RawRecord | Damage]:
    """All records from the one after the magic to the footer; what lies between readable parts is `Damage`."""
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
    """Whether the file ends in a footer, as a log does that was closed."""
    footer_bytes = RECORD.size + 8 + 8 + 4
    end = window.read(max(0, window.size - footer_bytes - len(MAGIC)), footer_bytes + len(MAGIC))
    return len(end) == footer_bytes + len(MAGIC) and end[0] == Opcode.FOOTER and bytes(end[footer_bytes:]) == MAGIC


def _record_at(window: FileWindow, offset: int) -> RawRecord | None:
    """The record at `offset`, None if what stands there cannot be one."""
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
        case _ if opcode == PADDING_OPCODE:
            plausible = content <= _PADDING_MAX
        case _:
            plausible = Opcode.HEADER <= opcode <= Opcode.DATA_END and content <= _SMALL_MAX
    return RawRecord(opcode, offset, RECORD.size + content) if plausible else None


def _is_chunk(window: FileWindow, offset: int, content: int) -> bool:
    """Whether the lengths in a chunk's head agree with its own length."""
    if not CHUNK_HEAD.size + 8 <= content <= CHUNK_MAX:
        return False
    _, _, size, _, name_bytes = CHUNK_HEAD.unpack(window.read(offset, CHUNK_HEAD.size))
    before = CHUNK_HEAD.size + name_bytes + 8
    if before > content or size > CHUNK_MAX:
        return False
    (stored,) = struct.unpack("<Q", window.read(offset + before - 8, 8))
    return bool(stored == content - before and (name_bytes or stored == size))


def _next_readable(window: FileWindow, offset: int) -> int | None:
    """The next page after `offset` on which a write of ours begins; None if there is none up to the end."""
    page = offset - offset % PAGE + PAGE
    while page < window.size:
        starts = np.frombuffer(window.read(page, _SEARCH_BYTES), np.uint8)[::PAGE]
        for candidate in np.flatnonzero(np.isin(starts, _PAGE_STARTS)):
            position = page + int(candidate) * PAGE
            if _begins_readable(window, position):
                return position
        page += _SEARCH_BYTES
    return None


def _begins_readable(window: FileWindow, offset: int) -> bool:
    """Whether a chunk with a message in it, or the end of the data, follows at `offset`, padding aside."""
    record = _record_at(window, offset)
    if record is not None and record.opcode == PADDING_OPCODE:
        record = _record_at(window, offset + record.length)
    if record is None:
        return False
    if record.opcode == Opcode.DATA_END:
        return record.length == RECORD.size + 4
    inner = window.read(record.offset + RECORD.size + CHUNK_HEAD.size + 8, RECORD.size)
    return record.opcode == Opcode.CHUNK and inner[0] == Opcode.MESSAGE and record.length > MESSAGE.size
