"""Logs that are cut off, damaged, or no logs: what can be read is right, the rest is named, nothing is invented."""

import shutil
import struct
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.opcode import Opcode
from mcap.writer import Writer

from recorder.checking.verify import VerifyReport, verify
from recorder.reading.info import info
from recorder.reading.items import Chunk, SmallRecord
from recorder.reading.log_reader import LogReader
from recorder.reading.triplets import triplets
from rig.errors import BadInputError
from tests.recorder.logs import ALL_OK, LOST, OK, Written, write_log

PULSES = (ALL_OK, (OK, LOST, OK), (LOST,) * 3, ALL_OK, ALL_OK, ALL_OK)


class Sample:
    """A closed log, and what else one wants to know about it."""

    def __init__(self, folder: Path) -> None:
        path = folder / "log.mcap"
        self._folder = folder
        self.written = write_log(path, PULSES)
        self.data = path.read_bytes()
        with LogReader(path) as reader:
            items = list(reader.items())
        self.chunks = [item for item in items if isinstance(item, Chunk)]
        self.data_end = next(
            item.offset for item in items if isinstance(item, SmallRecord) and item.opcode == Opcode.DATA_END
        )

    def spoilt(self, data: bytes) -> Path:
        """A file with other content."""
        path = self._folder / "spoilt.mcap"
        path.write_bytes(data)
        return path

    def with_bytes(self, offset: int, new: bytes) -> Path:
        """The log with some bytes replaced."""
        return self.spoilt(self.data[:offset] + new + self.data[offset + len(new) :])

    def chunk_of(self, pulse: int) -> Chunk:
        """The chunk that holds a pulse."""
        return next(c for c in self.chunks if any(m.sequence == pulse and "triplet" in m.topic for m in c.messages))


@pytest.fixture(scope="module")
def sample() -> Iterator[Sample]:
    folder = Path(tempfile.mkdtemp(prefix="svev"))
    yield Sample(folder)
    shutil.rmtree(folder)


def _read_pulses(path: Path, written: list[Written]) -> list[int]:
    """The pulses that can be read; each must be what was written."""
    found = list[int]()
    for tag, image in triplets(path):
        original = written[tag.pulse - 1]
        assert tag == original.tag
        assert np.array_equal(image, np.zeros(tag.shape) if original.image is None else original.image)
        found.append(tag.pulse)
    return found


def test_a_whole_log_is_read_whole(sample: Sample) -> None:
    assert _read_pulses(sample.spoilt(sample.data), sample.written) == [1, 2, 3, 4, 5, 6]


@settings(max_examples=150)
@given(data=st.data())
def test_cut_off_anywhere_the_pulses_before_are_read(sample: Sample, data: st.DataObject) -> None:
    edges = [edge for chunk in sample.chunks for edge in (chunk.offset, chunk.offset + chunk.length)]
    near = st.sampled_from(edges).flatmap(lambda edge: st.integers(edge - 40, edge + 40))
    end = data.draw(st.one_of(st.integers(0, len(sample.data) - 1), near, st.integers(0, 100)))
    path = sample.spoilt(sample.data[:end])
    whole = [w.tag.pulse for w in sample.written if _end_of(sample.chunk_of(w.tag.pulse)) <= end]
    try:
        report = verify(path)
    except BadInputError:
        assert end < 100  # inside of magic and header
        return
    assert _read_pulses(path, sample.written) == whole
    assert report.ledger.pulses == len(whole) == info(path).ledger.pulses
    assert not report.closed
    assert not report.ledger.missing
    assert report.damaged


def _end_of(chunk: Chunk) -> int:
    return chunk.offset + chunk.length


@settings(max_examples=200)
@given(data=st.data())
def test_a_changed_byte_is_found_and_costs_one_pulse_at_most(sample: Sample, data: st.DataObject) -> None:
    chunk = sample.chunks[data.draw(st.integers(0, len(sample.chunks) - 1))]
    head = st.integers(chunk.offset, chunk.offset + 120)
    offset = data.draw(st.one_of(head, st.integers(chunk.offset, _end_of(chunk) - 1)))
    path = sample.with_bytes(offset, bytes([sample.data[offset] ^ data.draw(st.integers(1, 255))]))
    report = verify(path)
    assert report.damaged
    assert report.findings
    expected = {1, 2, 3, 4, 5, 6} - (
        {m.sequence for m in chunk.messages} if "triplet" in chunk.messages[0].topic else set()
    )
    assert set(_read_pulses(path, sample.written)) >= expected
    info(path)


@settings(max_examples=150)
@given(data=st.data())
def test_a_changed_byte_behind_the_data_is_found(sample: Sample, data: st.DataObject) -> None:
    offset = data.draw(st.integers(sample.data_end, len(sample.data) - 1))
    path = sample.with_bytes(offset, bytes([sample.data[offset] ^ data.draw(st.integers(1, 255))]))
    report = verify(path)
    assert report.damaged
    assert _read_pulses(path, sample.written) == [1, 2, 3, 4, 5, 6]


@settings(max_examples=100)
@given(data=st.data())
def test_no_garbage_makes_reading_fail(sample: Sample, data: st.DataObject) -> None:
    offset = data.draw(st.integers(0, len(sample.data) - 1))
    path = sample.with_bytes(offset, data.draw(st.binary(min_size=1, max_size=9000)))
    try:
        verify(path)
        info(path)
        _read_pulses(path, sample.written)
    except BadInputError:
        assert offset < 100


def test_garbage_over_a_whole_triplet_costs_that_one_only(sample: Sample) -> None:
    chunk = sample.chunk_of(4)
    path = sample.with_bytes(chunk.offset - 200, bytes(range(1, 251)) * (chunk.length // 250))
    assert _read_pulses(path, sample.written) == [1, 2, 3, 5, 6]
    report = verify(path)
    assert report.ledger.missing == [(4, 4)]
    assert report.closed
    assert "pulse 4: no tag, nothing is known of it" in report.ledger.in_words()


@pytest.mark.parametrize("length", [1 << 20, 1 << 33, (1 << 64) - 1, 0])
def test_an_absurd_record_length_costs_its_pulse_only(sample: Sample, length: int) -> None:
    path = sample.with_bytes(sample.chunk_of(2).offset + 1, struct.pack("<Q", length))
    assert _read_pulses(path, sample.written) == [1, 3, 4, 5, 6]
    assert verify(path).ledger.missing == [(2, 2)]


def test_a_wrong_checksum_names_the_pulse(sample: Sample) -> None:
    chunk = sample.chunk_of(5)
    offset = chunk.messages[1].offset + 2000
    report = verify(sample.with_bytes(offset, bytes([sample.data[offset] ^ 1])))
    assert f"chunk at byte {chunk.offset} (pulse 5?): its checksum is wrong" in report.findings


def test_what_follows_the_end_is_noticed(sample: Sample) -> None:
    report = verify(sample.spoilt(sample.data + b"more"))
    assert report.damaged
    assert any("does not end as an MCAP log ends" in finding for finding in report.findings)


def test_zeros_at_the_end_as_after_a_power_loss_are_noticed(sample: Sample) -> None:
    cut = _end_of(sample.chunk_of(4))
    path = sample.spoilt(sample.data[:cut] + bytes(50_000))
    assert _read_pulses(path, sample.written) == [1, 2, 3, 4]
    report = verify(path)
    assert not report.closed
    assert any("unfinished record" in finding for finding in report.findings)


def _foreign(folder: Path) -> dict[str, Path]:
    files = {name: folder / name for name in ("empty", "text", "short", "other", "nothing", "folder")}
    files["empty"].touch()
    files["text"].write_text("not a log\n" * 100)
    files["short"].write_bytes(b"\x89MCAP0\r\n\x01")
    with files["other"].open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2", library="another program")
        writer.finish()  # type: ignore[no-untyped-call]
    files["folder"].mkdir()
    return files


@pytest.mark.parametrize("read", [verify, info, lambda path: list(triplets(path))])
@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("empty", "is empty; name a log of svev"),
        ("text", "is not an MCAP log; name a log of svev"),
        ("short", "is cut off or damaged before it says what it is"),
        ("other", 'is an MCAP log, but not written by svev (profile "ros2")'),
        ("nothing", "no such file; name an existing log"),
        ("folder", "is no file; name a log"),
    ],
)
def test_what_is_no_log_is_named_in_one_line(tmp_path: Path, read: VerifyReport, name: str, words: str) -> None:
    path = _foreign(tmp_path)[name]
    with pytest.raises(BadInputError) as error:
        read(path)  # type: ignore[operator]
    assert str(error.value).startswith(f"{path}: ")
    assert words in str(error.value)
    assert "\n" not in str(error.value)
