"""What the panel says of a recording in one line."""

from pathlib import Path

import pytest

from recorder.catalogue.entry import read_entry
from recorder.log.extent import ENDED_EARLY, extent
from recorder.log.triplet_buffers import TripletBuffers
from rig.frame import FrameStatus
from service.recordings.archive import verdict
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
    buffers = TripletBuffers(SHAPE, 4)
    with open_writer(tmp_path / "log.mcap", buffers) as log:
        write_pulse(log, buffers, make_tag(1))
        log.set_metadata("svev.recording", extent(make_tag(1).time, make_tag(1).time) | {ENDED_EARLY: why})
    buffers.close()
    said = verdict(read_entry(tmp_path / "log.mcap"))
    assert (said.code, said.level.value) == ("verdict_ended_early", "warning")
    assert said.text == f"Ended early: {why}. Complete: all 1 pulses"
    assert said.values["why"] == why
