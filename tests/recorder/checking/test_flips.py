"""One byte changed anywhere outside the pixels: `verify` never calls the log clean."""

import os
import random
from collections.abc import Iterator
from pathlib import Path

import pytest

from recorder.checking.verify import Verdict, verify
from rig.errors import BadInputError
from tests.recorder.logs import ALL_OK, LOST, OK, write_log
from tests.support.reliability import FaultTable

pytestmark = pytest.mark.long

PULSES = (ALL_OK, (OK, LOST, OK), ALL_OK)
#: All of it: 20 000, half a minute.
FLIPS = int(os.environ.get("SVEV_FLIPS", "3000"))


def _structure(data: bytes, images: list[bytes]) -> list[int]:
    """The offsets of all bytes that are no pixels."""
    pixels = bytearray(len(data))
    for image in images:
        begin = data.index(image)
        pixels[begin : begin + len(image)] = b"\1" * len(image)
    return [offset for offset, is_pixel in enumerate(pixels) if not is_pixel]


def _flips(places: list[int]) -> Iterator[tuple[int, int]]:
    """Place and change, single bits as often as bytes; every place once if there are so many flips."""
    random_ = random.Random(20261122)
    for number in range(FLIPS):
        place = places[number % len(places)] if len(places) <= FLIPS else random_.choice(places)
        change = 1 << random_.randrange(8) if random_.random() < 0.5 else random_.randrange(1, 256)
        yield place, change


def test_no_changed_byte_of_the_structure_is_called_clean(tmp_path: Path, fault_table: FaultTable) -> None:
    path = tmp_path / "log.mcap"
    written = write_log(path, PULSES)
    data = path.read_bytes()
    images = [pulse.image.tobytes() for pulse in written if pulse.image is not None]
    clean = []
    for place, change in _flips(_structure(data, images)):
        with path.open("r+b", buffering=0) as file:
            os.pwrite(file.fileno(), bytes([data[place] ^ change]), place)
            try:
                if verify(path).verdict is not Verdict.DAMAGED:
                    clean.append((place, change))
            except BadInputError:
                pass
            os.pwrite(file.fileno(), data[place : place + 1], place)
    assert clean == []
    what, said = f"one byte outside the pixels is changed, {FLIPS} times", "never clean: damaged, or no log of svev"
    fault_table.tell("Logs", what, lost="at most that pulse", said=said, code="2 or 3")
