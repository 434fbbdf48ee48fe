"""What the panel says of a recording in one line."""

import errno
from pathlib import Path

import pytest

from recorder.catalogue.entry import read_entry
from recorder.log.extent import ENDED_EARLY, ENDED_EARLY_SAID, as_field, extent
from recorder.log.triplet_buffers import TripletBuffers
from recorder.writing.append_file import storage_error
from rig.frame import FrameStatus
from rig.phrase import Phrase, plain
from service.recordings.verdicts import verdict
from tests.recorder.logs import ALL_OK, LOST, OK, SHAPE, make_tag, open_writer, write_pulse


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
