"""Recovering logs: whatever was cut off or destroyed, what comes out is whole, and what is lost is said."""

import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader

from recorder.catalogue.folder import Catalogue
from recorder.checking.verify import verify
from recorder.log.extent import extent
from recorder.log.mcap_layout import PAGE
from recorder.log.session_changes import write_session_changes
from recorder.log.triplet_buffers import TripletBuffers
from recorder.reading.info import info
from recorder.reading.log_reader import LogReader
from recorder.reading.triplets import triplets
from recorder.recovering.recover import RecoverReport, recover
from rig.clocks import NS_PER_S, UtcNs
from rig.errors import BadInputError, StorageError
from rig.events import Event, Level
from rig.frame import FrameStatus
from rig.tag import TripletTag
from rig.topics import JUMPER, RECORDING_METADATA, RECOVERY_METADATA, RIG_ATTACHMENT, RIG_METADATA
from svev.cli import main
from tests.recorder.logs import (
    ABSENT,
    ALL_OK,
    DESCRIPTION,
    LOST,
    OK,
    RIG,
    RIG_TOML,
    SESSION,
    SHAPE,
    START,
    Written,
    jumper_state,
    make_tag,
    open_writer,
    write_log,
    write_pulse,
)

PULSES = (ALL_OK, (OK, LOST, OK), ALL_OK, (ABSENT,) * 3, ALL_OK, ALL_OK, ALL_OK)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Written]]:
    path = tmp_path_factory.mktemp("whole") / "log.mcap"
    return path, write_log(path, PULSES)


def _check(report: RecoverReport, written: list[Written]) -> None:
    """What was recovered is sound, true and complete but for what the report says is lost."""
    path = report.path
    found = verify(path)
    assert found.verdict != "damaged", (found.findings, report)
    assert found.ledger.counts() == report.ledger.counts()
    with path.open("rb") as file:
        tags = sum(1 for _ in make_reader(file, validate_crcs=True).iter_messages(topics=["/triplet/tag"]))
    assert tags == found.ledger.pulses
    lost_pixels = {pulse for first, last in report.lost_pixels for pulse in range(first, last + 1)}
    by_pulse = {pulse.tag.pulse: pulse for pulse in written}
    for tag, image in triplets(path):
        original = by_pulse[tag.pulse]
        if tag.pulse in lost_pixels:
            # Where the tag was hit too, no more is known than that there was a pulse.
            assert tag in {_without_pixels(original.tag), make_tag(tag.pulse, (FrameStatus.DAMAGED,) * 3)}
            assert not image.any()
        else:
            assert tag == original.tag
            expected = np.zeros(SHAPE, np.uint8) if original.image is None else original.image
            assert np.array_equal(image, expected)
    last = found.ledger.last_pulse
    gaps = {pulse for first, end in found.ledger.missing for pulse in range(first, end + 1)}
    assert {pulse for pulse in by_pulse if pulse <= last} == {tag.pulse for tag, _ in triplets(path)} | gaps
    assert report.lossless == (not gaps and not lost_pixels and not report.findings)


def _without_pixels(tag: TripletTag) -> TripletTag:
    statuses = [FrameStatus.DAMAGED if camera.status is OK else camera.status for camera in tag.cameras]
    return make_tag(tag.pulse, statuses)


def test_a_whole_log_comes_out_as_it_went_in(whole: tuple[Path, list[Written]], tmp_path: Path) -> None:
    path, written = whole
    before = path.read_bytes()
    report = recover(path, tmp_path / "out.mcap")
    _check(report, written)
    assert (report.lossless, report.was_closed, report.ledger.pulses, report.ledger.missing) == (True, True, 7, [])
    assert path.read_bytes() == before
    with LogReader(path) as old, LogReader(report.path) as new:
        kept = [[(m.sequence, m.publish_time, m.log_time, bytes(m.data or b"")) for m in reader.messages(topic)]
                for topic in ("/triplet", "/triplet/tag", "/health") for reader in (old, new)]  # fmt: skip
        assert kept[0::2] == kept[1::2]
        events = [[bytes(m.data or b"") for m in reader.messages("/events")] for reader in (old, new)]
        assert events[1][:-1] == events[0]
        assert new.attachments == {RIG_ATTACHMENT: RIG_TOML}
        assert new.metadata[RIG_METADATA] == RIG
        assert new.metadata[RECOVERY_METADATA] | {"time": ""} == {
            "source": "log.mcap", "time": "", "lost_pulses": "", "lost_pixels": "",
        }  # fmt: skip
    message = verify(report.path).events[-1].message
    assert re.fullmatch(r"recovered from log\.mcap on 20[-0-9T:+]+: no pulse is lost", message)


def test_a_recovered_log_lasts_as_long_as_its_recording(tmp_path: Path) -> None:
    """Its first and its last message are of the recording, whenever it is repaired."""
    times = tuple(UtcNs(START + pulse * NS_PER_S) for pulse in (0, 5))
    write_log(tmp_path / "log.mcap", (ALL_OK,) * 4, health=(b'{"free_triplets":4}', times[1]))
    report = recover(tmp_path / "log.mcap", tmp_path / "out.mcap")
    with LogReader(report.path) as reader:
        logged = [message.log_time for topic in ("/health", "/triplet/tag") for message in reader.messages(topic)]
        *_, said = reader.messages("/events")
    assert said.log_time == max(logged) == times[1]


def test_the_session_is_the_one_that_was_corrected(whole: tuple[Path, list[Written]], tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    shutil.copy(whole[0], path)
    write_session_changes(path, {"bib": "3"})
    recover(path, tmp_path / "out.mcap")
    assert info(tmp_path / "out.mcap").session == SESSION | {"bib": "3"}


def test_a_pause_at_the_end_is_not_forgotten(tmp_path: Path) -> None:
    buffers = TripletBuffers(SHAPE, 4)
    with open_writer(tmp_path / "old.mcap", buffers) as log:
        for pulse in range(1, 6):
            write_pulse(log, buffers, make_tag(pulse))
        log.set_metadata(RECORDING_METADATA, extent(make_tag(1).time, make_tag(60).time))
    buffers.close()
    recover(tmp_path / "old.mcap", tmp_path / "new.mcap")
    old, new = verify(tmp_path / "old.mcap"), verify(tmp_path / "new.mcap")
    assert old.ledger.pauses() == new.ledger.pauses()
    assert (old.verdict, new.verdict) == ("partial", "partial")


@pytest.mark.parametrize("tail", [0, 5, 9, 60])
def test_an_unfinished_log_is_finished(whole: tuple[Path, list[Written]], tmp_path: Path, tail: int) -> None:
    """As a killed recorder leaves it, or with the beginning of the summary."""
    path, written = whole
    with LogReader(path) as reader:
        end = next(item.offset for item in reader.items() if getattr(item, "opcode", 0) == 0x0F)
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(path.read_bytes()[: end + tail])
    report = recover(cut, tmp_path / "out.mcap")
    _check(report, written)
    assert (report.lossless, report.was_closed, report.ledger.pulses) == (True, False, 7)
    assert verify(report.path).closed


def test_the_tag_of_the_pulse_that_was_being_written_is_kept(whole: tuple[Path, list[Written]], tmp_path: Path) -> None:
    path, written = whole
    data = path.read_bytes()
    image = written[4].image
    assert image is not None
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(data[: data.index(image.tobytes()) + 100])
    report = recover(cut, tmp_path / "out.mcap")
    _check(report, written)
    assert (report.ledger.last_pulse, report.lost_pixels, report.lossless) == (5, ((5, 5),), False)
    assert verify(report.path).verdict == "partial"


def test_pulses_that_are_gone_altogether_are_named_and_known(whole: tuple[Path, list[Written]], tmp_path: Path) -> None:
    path, written = whole
    data = bytearray(path.read_bytes())
    begin, end = data.index(b'{"pulse":2,'), data.index(b'{"pulse":6,')
    data[begin - 200 : end + 20] = bytes(end + 20 - (begin - 200))
    holed = tmp_path / "holed.mcap"
    holed.write_bytes(data)
    report = recover(holed, tmp_path / "out.mcap")
    _check(report, written)
    assert report.ledger.missing == [(2, 6)]
    found = verify(report.path)
    assert (found.verdict, found.known_lost) == ("partial", ((2, 6),))
    assert list(found.ledger.in_words()) == ["pulses 2-6: no tag, nothing is known of them"]
    assert Catalogue(tmp_path).entry("out").state == "closed"
    assert Catalogue(tmp_path).entry("holed").state == "damaged"
    assert report.in_words().startswith("pulses 2-6 altogether; ")


def test_a_destroyed_beginning_costs_no_pulse(whole: tuple[Path, list[Written]], tmp_path: Path) -> None:
    path, written = whole
    data = bytearray(path.read_bytes())
    data[:8192] = bytes(8192)
    beheaded = tmp_path / "beheaded.mcap"
    beheaded.write_bytes(data)
    report = recover(beheaded, tmp_path / "out.mcap")
    _check(report, written)
    assert (report.ledger.pulses, report.lossless) == (7, False)


@pytest.mark.parametrize("content", [b"", b"\x89MCAP0\r\n", b"RIFF" * 50_000, bytes(300_000)])
def test_what_holds_no_pulse_is_refused(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "log.mcap").write_bytes(content)
    with pytest.raises(BadInputError, match="no pulse of a log of svev can be read"):
        recover(tmp_path / "log.mcap", tmp_path / "out.mcap")
    assert not (tmp_path / "out.mcap").exists()


def test_a_log_without_pulses_and_a_missing_one_are_refused(tmp_path: Path) -> None:
    write_log(tmp_path / "log.mcap", ())
    with pytest.raises(BadInputError, match="no pulse"):
        recover(tmp_path / "log.mcap", tmp_path / "out.mcap")
    with pytest.raises(BadInputError, match="no such file"):
        recover(tmp_path / "none.mcap", tmp_path / "out.mcap")
    assert not (tmp_path / "out.mcap").exists()


def test_nothing_is_overwritten(whole: tuple[Path, list[Written]], tmp_path: Path) -> None:
    path, _ = whole
    before = path.read_bytes()
    with pytest.raises(BadInputError, match="exists already"):
        recover(path, path)
    assert path.read_bytes() == before
    with pytest.raises(BadInputError, match="no such directory"):
        recover(path, tmp_path / "none" / "out.mcap")


def test_names_as_long_as_a_file_system_takes_them(whole: tuple[Path, list[Written]], tmp_path: Path) -> None:
    log, out = tmp_path / f"{'å' * 125}.mcap", tmp_path / f"{'b' * 250}.mcap"
    shutil.copy(whole[0], log)
    assert main(["recover", str(log), "-o", str(out)]) == 0
    assert main(["verify", str(out)]) == 0
    assert main(["info", str(out)]) == 0
    assert {path.name for path in tmp_path.iterdir()} == {log.name, out.name}


def test_a_name_that_no_file_system_takes_is_refused_in_one_line(
    whole: tuple[Path, list[Written]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["recover", str(whole[0]), "-o", str(tmp_path / f"{'b' * 251}.mcap")]) == 2
    assert capsys.readouterr().err.endswith("File name too long; choose a name of at most 255 bytes\n")
    assert list(tmp_path.iterdir()) == []


def test_half_a_result_is_removed(whole: tuple[Path, list[Written]], tmp_path: Path) -> None:
    def full(_: int) -> None:
        raise StorageError("the disk is full")

    with pytest.raises(StorageError):
        recover(whole[0], tmp_path / "out.mcap", full)
    assert list(tmp_path.iterdir()) == []


def test_calibrations_and_early_events_come_along(tmp_path: Path) -> None:
    buffers = TripletBuffers(SHAPE, 4)
    calibrated = replace(DESCRIPTION, calibration_json=b"{}", calibrations={"K1": b"\n\x04left"})
    with open_writer(tmp_path / "log.mcap", buffers, calibrated) as log:
        log.set_metadata("svev.more", {"key": "value"})
        log.write_event(Event(UtcNs(5), Level.ERROR, "K2", "gone"))
        write_pulse(log, buffers, make_tag(1))
    buffers.close()
    assert recover(tmp_path / "log.mcap", tmp_path / "out.mcap").lossless
    with LogReader(tmp_path / "out.mcap") as reader:
        assert [bytes(m.data or b"") for m in reader.messages("/calibration/K1")] == [b"\n\x04left"]
        assert reader.attachments["calibration.json"] == b"{}"
        assert reader.metadata["svev.more"] == {"key": "value"}
    assert verify(tmp_path / "out.mcap").events[0].message == "gone"


def test_memory_does_not_grow_with_the_log(tmp_path: Path) -> None:
    """Four slots carry a log of a hundred."""
    written = write_log(tmp_path / "log.mcap", (ALL_OK,) * 100)
    _check(recover(tmp_path / "log.mcap", tmp_path / "out.mcap"), written)


def test_a_pulse_that_is_just_being_written_is_not_called_lost(
    whole: tuple[Path, list[Written]], tmp_path: Path
) -> None:
    """The recorder goes on while its log is recovered."""
    path, written = whole
    data = path.read_bytes()
    image = written[5].image
    assert image is not None
    now = data.index(image.tobytes()) + 100
    growing = tmp_path / "growing.mcap"
    growing.write_bytes(data[:now])

    def go_on(_: int) -> None:
        growing.write_bytes(data[: now + 5000])

    report = recover(growing, tmp_path / "out.mcap", go_on)
    _check(report, written)
    assert (report.lossless, report.ledger.last_pulse) == (True, 5)


def test_a_log_is_recovered_while_a_process_writes_it(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    command = [sys.executable, "-m", "tests.recorder.writing.writing_process", str(path)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=Path(__file__).parents[3]) as process:
        assert process.stdout is not None
        while (safe := int(process.stdout.readline())) < 20:
            pass
        report = recover(path, tmp_path / "out.mcap")
        process.kill()
    assert report.ledger.complete >= safe
    assert not report.ledger.missing
    assert not verify(report.path).damaged


def test_what_a_torn_end_held_is_said_in_the_new_log(whole: tuple[Path, list[Written]], tmp_path: Path) -> None:
    path, _ = whole
    data = path.read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(data[: data.index(b'{"pulse":5,') - 20])  # in the head of the chunk
    report = recover(cut, tmp_path / "out.mcap")
    assert not report.lossless
    assert report.in_words().startswith("the last ")
    told = f": this is lost: {report.in_words()}; {report.end_unknown}"
    assert verify(report.path).events[-1].message.endswith(told)
    assert verify(report.path).events[-1].level == "warning"


def test_changed_session_fields_of_a_closed_log_are_noticed(whole: tuple[Path, list[Written]], tmp_path: Path) -> None:
    """Nothing but the checksum over everything knows."""
    path = tmp_path / "log.mcap"
    path.write_bytes(whole[0].read_bytes().replace(b"Anna Berg", b"Anne Berg"))
    report = recover(path, tmp_path / "out.mcap")
    assert not report.lossless
    assert "session, rig or attachments may be false" in report.in_words()
    assert verify(report.path).every_byte


def test_pulses_of_another_recording_are_left_out(whole: tuple[Path, list[Written]], tmp_path: Path) -> None:
    """As a block that the disk had not overwritten yet."""
    path, written = whole
    buffers = TripletBuffers(SHAPE, 4)
    with open_writer(tmp_path / "other.mcap", buffers) as log:
        for pulse in range(1, 5):
            write_pulse(log, buffers, msgspec.structs.replace(make_tag(pulse), recording="r0"))
    buffers.close()
    other, data = (tmp_path / "other.mcap").read_bytes(), path.read_bytes()
    place = data.index(b'{"pulse":7,') // PAGE * PAGE
    chunk = other.index(b'{"pulse":3,') // PAGE * PAGE
    (tmp_path / "log.mcap").write_bytes(data[:place] + other[chunk : chunk + 3 * PAGE] + data[place + 3 * PAGE :])
    report = recover(tmp_path / "log.mcap", tmp_path / "out.mcap")
    _check(report, written)
    assert "pulse 3: its tag is of another recording or other cameras, left out" in report.findings
    assert report.ledger.last_pulse == 6


@contextmanager
def _fresh(factory: pytest.TempPathFactory, data: bytes) -> Iterator[Path]:
    folder = factory.mktemp("logs")
    (folder / "log.mcap").write_bytes(data)
    yield folder
    shutil.rmtree(folder)


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(where=st.floats(0.05, 1))
def test_cut_anywhere(
    whole: tuple[Path, list[Written]], tmp_path_factory: pytest.TempPathFactory, where: float
) -> None:
    """All whole pulses before the cut are there."""
    path, written = whole
    data = path.read_bytes()
    cut = data[: round(where * len(data))]
    with _fresh(tmp_path_factory, cut) as folder:
        pulses = sum(pulse.image is not None and pulse.image.tobytes() in cut for pulse in written)
        if not pulses:
            return
        report = recover(folder / "log.mcap", folder / "out.mcap")
        _check(report, written)
        assert report.ledger.missing == []
        assert sum(1 for _, image in triplets(report.path) if image.any()) == pulses


@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(flips=st.lists(st.tuples(st.floats(0, 0.9999), st.integers(1, 255)), min_size=1, max_size=4))
@example(flips=[(0.0, 1)])
def test_bytes_flipped_anywhere(
    whole: tuple[Path, list[Written]], tmp_path_factory: pytest.TempPathFactory, flips: list[tuple[float, int]]
) -> None:
    """A flipped byte costs the image of one pulse at most; everything else is there, and true."""
    path, written = whole
    data = bytearray(path.read_bytes())
    for where, change in flips:
        data[int(where * len(data))] ^= change
    with _fresh(tmp_path_factory, bytes(data)) as folder:
        report = recover(folder / "log.mcap", folder / "out.mcap")
        _check(report, written)
        lost = sum(last - first + 1 for first, last in (*report.lost_pixels, *report.ledger.missing))
        assert report.ledger.last_pulse >= 7 - len(flips)
        assert lost <= len(flips)
        assert report.ledger.pulses == 7 or not report.lossless


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(begin=st.floats(0, 0.9), length=st.floats(0.001, 0.3), fill=st.binary(min_size=1, max_size=64))
def test_holes_anywhere(
    whole: tuple[Path, list[Written]],
    tmp_path_factory: pytest.TempPathFactory,
    begin: float,
    length: float,
    fill: bytes,
) -> None:
    """A stretch overwritten with something else costs the pulses in it and no others."""
    path, written = whole
    data = bytearray(path.read_bytes())
    first, last = round(begin * len(data)), min(len(data), round((begin + length) * len(data)))
    data[first:last] = (fill * len(data))[: last - first]
    with _fresh(tmp_path_factory, bytes(data)) as folder:
        unhurt = sum(pulse.image is not None and pulse.image.tobytes() in data for pulse in written)
        report = recover(folder / "log.mcap", folder / "out.mcap")
        _check(report, written)
        assert sum(1 for _, image in triplets(report.path) if image.any()) >= unhurt - 2
        assert report.ledger.pulses == 7 or not report.lossless


def test_results_of_the_analysis_are_kept_under_the_numbers_of_their_pulses(tmp_path: Path) -> None:
    path, buffers = tmp_path / "log.mcap", TripletBuffers(SHAPE, 4)
    states = [jumper_state(pulse) for pulse in (1, 3)]
    with open_writer(path, buffers) as log:
        for pulse in range(1, 5):
            write_pulse(log, buffers, make_tag(pulse))
        for state in states:
            log.write_message(JUMPER.name, state.encode(), state.time, state.time, state.pulse)
    buffers.close()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(path.read_bytes()[: path.stat().st_size - 4 * PAGE])
    report = recover(cut, tmp_path / "recovered.mcap")
    with report.path.open("rb") as file:
        found = [(m.sequence, m.data) for _, _, m in make_reader(file).iter_messages(topics=["/jumper"])]
    kept = [(state.pulse, state.encode()) for state in states]
    assert found
    assert found == kept[: len(found)]
