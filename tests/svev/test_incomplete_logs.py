"""Exit codes of `svev info`, `verify` and `recover` for logs that are not, or not yet, a whole recording."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from recorder.log.extent import CONTINUES, ENDED_EARLY, extent
from recorder.log.triplet_buffers import TripletBuffers
from svev.cli import main
from tests.recorder.logs import ALL_OK, DESCRIPTION, SESSION, SHAPE, make_tag, open_writer, write_log, write_pulse
from tests.support.waiting import wait_until

WHY = "the disk fails: look at `dmesg` and its cable, and record to another disk"


@pytest.mark.parametrize("command", ["info", "verify"])
@pytest.mark.parametrize("torn", [False, True])
def test_a_log_in_the_making_is_no_whole_recording_and_no_cut_off_copy(
    tmp_path: Path, command: str, torn: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    path, buffers = tmp_path / "now.mcap", TripletBuffers(SHAPE, 4)
    with open_writer(path, buffers) as log:
        write_pulse(log, buffers, make_tag(1))
        wait_until(lambda: log.pulses == 1, "the pulse is in the file")
        if torn:  # the kernel has taken half of a record
            with path.open("ab") as file:
                file.write(b"\x06" + (500).to_bytes(8, "little") + b"half")
        assert main([command, str(path)]) == 3
        assert "the log is still being written: " in capsys.readouterr().err
        assert main([command, str(path), "--json"]) == 3
        assert json.loads(capsys.readouterr().out)["being_written"] is True
    buffers.close()


def test_a_log_in_the_making_is_neither_compacted_nor_merged(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """To recover it, as one does with a log that was not closed, would give a part of the recording."""
    path, whole, out, buffers = (
        (tmp_path / "now.mcap"),
        tmp_path / "whole.mcap",
        tmp_path / "new.mcap",
        TripletBuffers(SHAPE, 4),
    )
    write_log(whole, (ALL_OK,))
    with open_writer(path, buffers) as log:
        write_pulse(log, buffers, make_tag(1))
        wait_until(lambda: log.pulses == 1, "the pulse is in the file")
        for command in (["compact", path], ["merge", path, whole], ["merge", whole, path]):
            assert main([*map(str, command), "-o", str(out)]) == 3
            assert f"{path}: is still being written; {command[0]} it when the recording has" in capsys.readouterr().err
    buffers.close()
    assert not out.exists()


def test_what_is_recovered_of_a_log_in_the_making_says_that_more_came(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, out, buffers = tmp_path / "now.mcap", tmp_path / "part.mcap", TripletBuffers(SHAPE, 4)
    with open_writer(path, buffers) as log:
        write_pulse(log, buffers, make_tag(1))
        wait_until(lambda: log.pulses == 1, "the pulse is in the file")
        assert main(["recover", str(path), "-o", str(out)]) == 3
        assert f"recovered into {out}, but it is still being written: recover it again" in capsys.readouterr().err
    buffers.close()
    assert main(["verify", str(out)]) == 3
    said = capsys.readouterr()
    assert f"{out}: not the whole recording: it was still being written: more pulses came after pulse 1" in said.err


@pytest.mark.parametrize("command", ["info", "verify"])
def test_a_recording_that_ended_early_is_told_by_the_exit_code(
    tmp_path: Path, command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path, buffers = tmp_path / "log.mcap", TripletBuffers(SHAPE, 4)
    with open_writer(path, buffers) as log:
        write_pulse(log, buffers, make_tag(1))
        log.set_metadata("svev.recording", extent(make_tag(1).time, make_tag(1).time) | {ENDED_EARLY: WHY})
    buffers.close()
    assert main([command, str(path)]) == 3
    assert f"{path}: not the whole recording: {WHY}; what it holds is sound" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["info", "verify"])
def test_a_later_part_is_whole_beside_the_one_before(
    tmp_path: Path, command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    part = tmp_path / "jump-part2.mcap"
    write_log(part, description=replace(DESCRIPTION, session=SESSION | {CONTINUES: "jump"}))
    assert main([command, str(part)]) == 3
    assert "not the whole recording: goes on from jump, which does not lie beside it: put" in capsys.readouterr().err
    write_log(tmp_path / "jump.mcap", (ALL_OK,))
    assert main([command, str(part)]) == 0


def test_an_end_that_nobody_knows_is_told_by_the_exit_code_of_verify_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """All that the log holds is in the new one; whether that is the whole recording is another question."""
    path, out = tmp_path / "log.mcap", tmp_path / "new.mcap"
    write_log(path, (ALL_OK,) * 5)
    data = path.read_bytes()
    path.write_bytes(data[: data.index(b"\x0f\x04\0\0\0\0\0\0\0")])
    assert main(["recover", str(path), "-o", str(out)]) == 0
    assert main(["verify", str(out)]) == 3
    assert "nobody knows whether pulses came after pulse 5" in capsys.readouterr().err
