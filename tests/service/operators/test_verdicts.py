"""What the panel says of a recording in one line."""

import errno
from contextlib import closing
from pathlib import Path

import pytest

from recorder.catalogue.entry import read_entry
from recorder.catalogue.folder import Catalogue
from recorder.log.extent import ENDED_EARLY, ENDED_EARLY_SAID, as_field, extent
from recorder.log.triplet_buffers import TripletBuffers
from recorder.writing.append_file import storage_error
from rig.api.recordings import RecordingQuery
from rig.api.statement import Level
from rig.frame import FrameStatus
from rig.phrase import Phrase, plain
from service.recordings.describing import Chain, as_recording
from service.recordings.measured_jumps import LogJudge
from service.recordings.verdicts import verdict
from tests.recorder.logs import ALL_OK, LOST, OK, SHAPE, make_tag, open_writer, write_log, write_pulse
from tests.recorder.split import split_log


@pytest.mark.parametrize(
    ("end", "fate", "code", "words"),
    [
        (5, OK, "verdict_complete", "Complete: all 5 pulses"),
        (5, LOST, "verdict_partial", "1 of 5 pulses lack a frame: K2 1 lost"),
        (65, OK, "verdict_paused", "5 pulses, all complete, but no pulses for 2 s"),
        (65, LOST, "verdict_partial_paused", "1 of 5 pulses lack a frame: K2 1 lost; no pulses for 2 s"),
    ],
)
def test_a_recording_with_a_pause_is_never_called_complete(
    tmp_path: Path, end: int, fate: FrameStatus, code: str, words: str
) -> None:
    buffers = TripletBuffers(SHAPE, 4)
    with open_writer(tmp_path / "log.mcap", buffers) as log:
        for pulse in range(1, 6):
            write_pulse(log, buffers, make_tag(pulse, (OK, fate, OK) if pulse == 3 else ALL_OK))
        log.set_metadata("svev.recording", extent(make_tag(1).time, make_tag(end).time))
    buffers.close()
    said = verdict(read_entry(tmp_path / "log.mcap"))
    assert (said.code, said.text) == (code, words)
    assert (said.level.value == "good") == (code == "verdict_complete")


def test_a_recording_that_ended_early_is_never_called_complete(tmp_path: Path) -> None:
    why = "the disk fails: look at `dmesg` and its cable, and record to another disk"
    said = verdict(read_entry(_log(tmp_path, {ENDED_EARLY: why})))
    assert (said.code, said.level.value) == ("verdict_ended_early", "warning")
    assert said.text == f"Ended early: {why}. Complete: all 1 pulses"
    assert said.values["why"] == plain(why)


@pytest.mark.parametrize(
    "strange", ["", "{", '{"code": "disk_fails", "text": "all is well", "values": {}}', "[" * 5000]
)
def test_a_reason_is_a_phrase_only_if_it_says_what_the_text_beside_it_says(tmp_path: Path, strange: str) -> None:
    why = {ENDED_EARLY: "the disk fails", ENDED_EARLY_SAID: strange}
    assert read_entry(_log(tmp_path, why)).ended_early == plain("the disk fails")


def test_a_full_disk_is_named_and_what_is_there_is_said_in_any_language(tmp_path: Path) -> None:
    full = storage_error(tmp_path / "log.mcap", OSError(errno.ENOSPC, "No space left on device")).said
    said = verdict(read_entry(_log(tmp_path, {ENDED_EARLY: full.text, ENDED_EARLY_SAID: as_field(full)})))
    assert (said.code, said.level.value) == ("verdict_disk_full", "warning")
    assert said.text == "The disk was full, and the recording ended early. Complete: all 1 pulses"
    assert "empty the trash" in said.advice
    rest, why = said.values["rest"], said.values["why"]
    assert isinstance(rest, Phrase)
    assert isinstance(why, Phrase)
    assert (rest.code, rest.values["pulses"], why.code) == ("verdict_complete", 1, "disk_full")


def _log(folder: Path, fields: dict[str, str]) -> Path:
    """A log of one pulse whose recording had these fields at its end."""
    path, buffers = folder / "log.mcap", TripletBuffers(SHAPE, 4)
    with open_writer(path, buffers) as log:
        write_pulse(log, buffers, make_tag(1))
        log.set_metadata("svev.recording", extent(make_tag(1).time, make_tag(1).time) | fields)
    buffers.close()
    return path


@pytest.mark.parametrize(
    ("gone", "code", "words"),
    [
        (
            0,
            "verdict_part_gone",
            "Goes on from r1, which is not here: the beginning is missing. Complete: all 6 pulses",
        ),
        (
            2,
            "verdict_next_part_gone",
            "Goes on in r1-part3, which is not here: the end is missing. Complete: all 7 pulses",
        ),
    ],
)
def test_a_recording_whose_first_or_last_part_is_gone_is_not_complete(
    gone: int, code: str, words: str, tmp_path: Path
) -> None:
    log, folder = tmp_path / "whole.mcap", tmp_path / "recordings"
    folder.mkdir()
    write_log(log, (ALL_OK,) * 10)
    parts = split_log(log, folder / "r1.mcap", (4, 3))
    part = parts[gone].read_bytes()
    parts[gone].unlink()
    with closing(Catalogue(folder, LogJudge())) as catalogue:
        (entry,) = catalogue.entries()
        said = Chain(catalogue, [entry]).pointing_on(as_recording(entry)).verdict
        assert (said.level, said.code, said.text) == (Level.WARNING, code, words)
        assert _found(catalogue) == {"verdict:warning": [entry.id], "verdict:good": []}
        (folder / ".trash").mkdir()
        (folder / ".trash" / parts[gone].name).write_bytes(part)
        assert Chain(catalogue, [entry]).pointing_on(as_recording(entry)).verdict.level is Level.GOOD
        assert _found(catalogue) == {"verdict:warning": [], "verdict:good": [entry.id]}


def _found(catalogue: Catalogue) -> dict[str, list[str]]:
    """What is found under two verdicts, as a text and as a condition of its own."""
    found = {}
    for level in (Level.WARNING, Level.GOOD):
        text = f"verdict:{level}"
        by_text, by_level = (
            [entry.id for entry in catalogue.find(query).entries]
            for query in (RecordingQuery(search=text), RecordingQuery(verdict=level))
        )
        assert by_text == by_level
        found[text] = by_text
    return found
