"""A log as it is handed out after its session was corrected: sound, with the same frames, whatever the new length."""

import io
import os
import random
from pathlib import Path

import pytest
from mcap.reader import make_reader

from recorder.checking.verify import Verdict, verify
from recorder.log.session_changes import write_session_changes
from recorder.reading.corrected_log import corrected_log
from recorder.reading.info import info
from recorder.recovering.recover import recover
from rig.errors import BadInputError
from rig.topics import SESSION_METADATA
from tests.recorder.logs import ALL_OK, DAMAGED, LOST, OK, OWN_TOPICS, SESSION, write_log

PULSES = (ALL_OK, (OK, LOST, OK), ALL_OK, (LOST, LOST, LOST), (OK, OK, DAMAGED), *(ALL_OK,) * 20)
#: Lengths about which the padding behind the opening is used up, and about which it takes another page.
LENGTHS = (0, 1, 10, 1000, 2000, 3500, *range(3800, 4300, 61), 5000, 9000, 40_000)


def _content(log: bytes) -> tuple[list[tuple[str, int, int, int, bytes]], dict[str, dict[str, str]], dict[str, bytes]]:
    """All messages by the index, metadata and attachments, as the `mcap` library reads them."""
    reader = make_reader(io.BytesIO(log), validate_crcs=True)
    messages = [
        (channel.topic, message.sequence, message.log_time, message.publish_time, message.data)
        for _, channel, message in reader.iter_messages(log_time_order=False)
    ]
    metadata = {each.name: each.metadata for each in reader.iter_metadata()}
    return messages, metadata, {each.name: each.data for each in reader.iter_attachments()}


@pytest.mark.parametrize("cameras", [(), OWN_TOPICS])
def test_a_corrected_log_is_sound_and_has_the_same_frames(
    tmp_path: Path, cameras: tuple[tuple[str, tuple[int, int]], ...]
) -> None:
    original, copy = tmp_path / "jump.mcap", tmp_path / "copy.mcap"
    write_log(original, PULSES, cameras=cameras)
    before, data = original.stat(), original.read_bytes()
    messages, metadata, attachments = _content(data)
    sizes = set()
    for length in LENGTHS:
        changes = {"athlete": "Bjørn Ødegård", "notes": "x" * length}
        log = corrected_log(original, changes)
        assert log.corrected
        with log.open() as file:
            corrected = file.read()
        assert len(corrected) == log.size
        found = _content(corrected)
        assert found == (messages, {**metadata, SESSION_METADATA: {**SESSION, **changes}}, attachments), length
        copy.write_bytes(corrected)
        report = verify(copy)
        assert (report.verdict, report.findings, report.every_byte) == (Verdict.PARTIAL, (), True), length
        sizes.add(log.size)
    assert len(sizes) > 2
    assert (original.read_bytes(), original.stat().st_mtime_ns) == (data, before.st_mtime_ns)


def test_a_shorter_session_leaves_the_log_as_long(tmp_path: Path) -> None:
    write_log(tmp_path / "jump.mcap", PULSES)
    log = corrected_log(tmp_path / "jump.mcap", {"athlete": "", "bib": ""})
    assert log.corrected
    assert log.size == (tmp_path / "jump.mcap").stat().st_size
    with log.open() as file:
        (tmp_path / "copy.mcap").write_bytes(file.read())
    assert info(tmp_path / "copy.mcap").session == {"athlete": "", "bib": ""}
    assert verify(tmp_path / "copy.mcap").verdict is Verdict.PARTIAL


def test_any_part_can_be_read(tmp_path: Path) -> None:
    write_log(tmp_path / "jump.mcap", PULSES)
    log = corrected_log(tmp_path / "jump.mcap", {"notes": "x" * 9000})
    drawn = random.Random(1)
    with log.open() as file:
        whole = file.read()
        for _ in range(200):
            begin, length = drawn.randrange(log.size), drawn.choice((1, 100, 5000, 1 << 20))
            file.seek(begin)
            assert file.read(length) == whole[begin : begin + length]
        assert file.seek(-10, os.SEEK_END) == log.size - 10
        assert file.read() == whole[-10:]


def test_without_changes_it_is_the_original(tmp_path: Path) -> None:
    write_log(tmp_path / "jump.mcap", PULSES)
    log = corrected_log(tmp_path / "jump.mcap", {})
    assert not log.corrected
    with log.open() as file:
        assert file.read() == (tmp_path / "jump.mcap").read_bytes()


def test_a_log_that_was_not_closed_is_corrected_and_can_be_recovered(tmp_path: Path) -> None:
    write_log(tmp_path / "jump.mcap", PULSES)
    data = (tmp_path / "jump.mcap").read_bytes()
    (tmp_path / "torn.mcap").write_bytes(data[: len(data) * 2 // 3])
    log = corrected_log(tmp_path / "torn.mcap", {"bib": "18", "notes": "x" * 6000})
    assert log.corrected
    with log.open() as file:
        (tmp_path / "copy.mcap").write_bytes(file.read())
    there = info(tmp_path / "torn.mcap").ledger.pulses
    assert info(tmp_path / "copy.mcap").session["bib"] == "18"
    assert recover(tmp_path / "copy.mcap", tmp_path / "whole.mcap").ledger.pulses == there > 0
    assert info(tmp_path / "whole.mcap").session["bib"] == "18"


def test_no_correction_hides_damage(tmp_path: Path) -> None:
    original, copy = tmp_path / "jump.mcap", tmp_path / "copy.mcap"
    write_log(original, PULSES)
    data = original.read_bytes()
    drawn, corrected = random.Random(2), 0
    for place in (*range(0, 3000, 97), *(drawn.randrange(len(data)) for _ in range(80))):
        flipped = bytearray(data)
        flipped[place] ^= 1 << drawn.randrange(8)
        original.write_bytes(flipped)
        log = corrected_log(original, {"notes": "x" * drawn.choice((10, 5000))})
        corrected += log.corrected
        with log.open() as file:
            copy.write_bytes(file.read())
        try:
            before = verify(original).verdict
        except Exception as error:  # noqa: BLE001 - whatever it is, the copy has it too
            with pytest.raises(type(error)):
                verify(copy)
        else:
            assert verify(copy).verdict is before is Verdict.DAMAGED, place
    assert corrected > 50


def test_what_cannot_be_corrected_is_the_original(tmp_path: Path) -> None:
    for name, data in (("empty", b""), ("text", b"wind from the left\n" * 1000), ("magic", b"\x89MCAP0\r\n")):
        path = tmp_path / f"{name}.mcap"
        path.write_bytes(data)
        log = corrected_log(path, {"bib": "1"})
        assert not log.corrected
        with log.open() as file:
            assert file.read() == data


def test_changes_beside_a_corrected_copy_are_changes_of_it(tmp_path: Path) -> None:
    write_log(tmp_path / "jump.mcap", PULSES)
    with corrected_log(tmp_path / "jump.mcap", {"bib": "18"}).open() as file:
        (tmp_path / "copy.mcap").write_bytes(file.read())
    write_session_changes(tmp_path / "copy.mcap", {"gate": "9"})
    with corrected_log(tmp_path / "copy.mcap", {"gate": "9"}).open() as file:
        (tmp_path / "again.mcap").write_bytes(file.read())
    assert info(tmp_path / "again.mcap").session == {**SESSION, "bib": "18", "gate": "9"}


@pytest.mark.parametrize("changes", [{}, {"bib": "18"}])
def test_another_file_that_gets_the_name_is_not_taken_for_the_log(tmp_path: Path, changes: dict[str, str]) -> None:
    """The pieces were laid out for the first one."""
    path = tmp_path / "jump.mcap"
    write_log(path, PULSES)
    write_log(tmp_path / "other.mcap", PULSES)
    log = corrected_log(path, changes)
    (tmp_path / "other.mcap").replace(path)
    with pytest.raises(BadInputError, match="is another file than before: load the page again"):
        log.open()


def test_a_link_is_not_corrected(tmp_path: Path) -> None:
    write_log(tmp_path / "jump.mcap", PULSES)
    (tmp_path / "link.mcap").symlink_to("jump.mcap")
    with pytest.raises(BadInputError, match="is a link, and links are not followed; put the log itself here"):
        corrected_log(tmp_path / "link.mcap", {})
