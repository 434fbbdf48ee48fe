"""Damages logs in every way that disks, copies and crashes do; the same seed gives the same damage."""

import random
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from recorder.log.mcap_layout import PAGE
from recorder.reading.items import Chunk
from recorder.reading.log_reader import LogReader
from tests.recorder.logs import ABSENT, ALL_OK, LOST, OK, Written, write_log

PULSES = (ALL_OK, (OK, LOST, OK), ALL_OK, (ABSENT,) * 3, *(ALL_OK,) * 8)


@dataclass(frozen=True, slots=True)
class Original:
    """A sound log: its bytes, the bytes of each pulse's chunk, and what was written."""

    data: bytes
    chunks: dict[int, bytes]
    written: dict[int, Written]

    def intact_in(self, data: bytes) -> set[int]:
        """The pulses whose chunk stands somewhere in `data`, whole."""
        return {pulse for pulse, chunk in self.chunks.items() if chunk in data}


def make_original(folder: Path) -> Original:
    """A log of 12 pulses; in one a frame is lost, in another all cameras are absent."""
    path = folder / "original.mcap"
    written = write_log(path, PULSES)
    data = path.read_bytes()
    chunks = {}
    with LogReader(path) as reader:
        for item in reader.items():
            if isinstance(item, Chunk) and any(message.topic == "/triplet/tag" for message in item.messages):
                chunks[item.messages[0].sequence] = data[item.offset : item.offset + item.length]
    path.unlink()
    return Original(data, chunks, {pulse.tag.pulse: pulse for pulse in written})


def cut(data: bytes, random_: random.Random) -> bytes:
    """The end is missing, or only its first part came before the power went; zeros may stand in its place."""
    end = random_.randrange(len(data))
    return data[:end] + bytes(random_.choice((0, 0, 0, random_.randrange(3 * PAGE))))


def corrupted(data: bytes, random_: random.Random) -> bytes:
    """One of: changed bytes, overwritten stretches, zeroed padding, bytes missing, bytes too many, blocks exchanged."""
    return random_.choice(_CORRUPTIONS)(data, random_)


def with_copied_block(data: bytes, random_: random.Random) -> bytes:
    """A block stands in another place too, where it has overwritten what was there; mostly whole pages."""
    unit = random_.choice((PAGE, PAGE, PAGE, 512, 1))
    units = len(data) // unit
    length = random_.randrange(1, max(2, min(units // 3, 12 * PAGE // unit)))
    source, target = (random_.randrange(units - length) * unit for _ in range(2))
    return _over(data, target, data[source : source + length * unit])


def _over(data: bytes, place: int, new: bytes) -> bytes:
    return data[:place] + new + data[place + len(new) :]


def _changed_bytes(data: bytes, random_: random.Random) -> bytes:
    changed = bytearray(data)
    for _ in range(random_.randrange(1, 6)):
        changed[random_.randrange(len(data))] ^= random_.randrange(1, 256)
    return bytes(changed)


def _changed_letter(data: bytes, random_: random.Random) -> bytes:
    """In a tag, and a pixel of the same chunk, so that the tag stands in damaged bytes."""
    tag = data.index(b'{"pulse":%d,' % random_.choice((1, 3, 5, 9)))
    changed = bytearray(data)
    changed[tag + random_.randrange(400)] ^= 1 << random_.randrange(3)
    changed[tag + random_.randrange(1500, 2500)] ^= 1
    return bytes(changed)


def _overwritten(data: bytes, random_: random.Random) -> bytes:
    length = random_.randrange(1, random_.choice((20, PAGE, len(data) // 4)))
    fill = random_.choice(
        (bytes(length), random_.randbytes(length), b"\xff" * length, (b"\x06\x00\x01" * length)[:length])
    )
    return _over(data, random_.randrange(len(data) - length), fill)


def _zeroed_padding(data: bytes, random_: random.Random) -> bytes:
    """The page in which a chunk begins is zero up to the chunk, or a bit into it."""
    chunk = data.index(b'{"pulse":%d,' % random_.randrange(1, 12)) - 80
    end = chunk + random_.choice((0, 0, -1, -9, 1, 60))
    begin = max(8, end - random_.randrange(1, 2 * PAGE))
    return _over(data, begin, bytes(end - begin))


def _missing(data: bytes, random_: random.Random) -> bytes:
    place, length = random_.randrange(len(data)), random_.randrange(1, random_.choice((9, 3 * PAGE)))
    return data[:place] + data[place + length :]


def _too_many(data: bytes, random_: random.Random) -> bytes:
    place = random_.randrange(len(data))
    return data[:place] + random_.randbytes(random_.randrange(1, random_.choice((9, 3 * PAGE)))) + data[place:]


def _exchanged(data: bytes, random_: random.Random) -> bytes:
    length = random_.randrange(1, 8) * PAGE
    first = random_.randrange(len(data) // 2 - length)
    second = random_.randrange(len(data) // 2, len(data) - length)
    return _over(_over(data, first, data[second : second + length]), second, data[first : first + length])


_CORRUPTIONS: tuple[Callable[[bytes, random.Random], bytes], ...] = (
    _changed_bytes, _changed_letter, _overwritten, _zeroed_padding, _missing, _too_many, _exchanged,
)  # fmt: skip
