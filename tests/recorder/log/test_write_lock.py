"""A log in the making is marked by its writer, and by nobody else, until the writer ends, however it ends."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from recorder.catalogue.entry import LogState
from recorder.catalogue.folder import Catalogue
from recorder.checking.verify import verify
from recorder.log.triplet_buffers import TripletBuffers
from recorder.log.write_lock import is_being_written
from rig.errors import StillRecordingError
from tests.recorder.logs import SHAPE, make_tag, open_writer, write_log, write_pulse

ROOT = Path(__file__).parents[3]


def test_a_log_is_marked_from_its_first_byte_until_it_is_closed(tmp_path: Path) -> None:
    buffers = TripletBuffers(SHAPE, 4)
    with open_writer(tmp_path / "now.mcap", buffers) as log:
        assert is_being_written(tmp_path / "now.mcap")
        write_pulse(log, buffers, make_tag(1))
        assert "the log is still being written: verify it when the recording has ended" in (
            verify(tmp_path / "now.mcap").findings
        )
    buffers.close()
    assert not is_being_written(tmp_path / "now.mcap")


@pytest.mark.parametrize("kind", ["closed log", "nothing", "link", "pipe", "folder"])
def test_what_nobody_writes_is_not_marked(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "it.mcap"
    match kind:
        case "closed log":
            write_log(path)
        case "link":
            path.symlink_to(tmp_path / "elsewhere")
        case "pipe":
            os.mkfifo(path)
        case "folder":
            path.mkdir()
        case _:
            pass
    assert not is_being_written(path)


def test_nobody_deletes_a_log_that_another_process_writes(tmp_path: Path) -> None:
    catalogue, trash = Catalogue(tmp_path), tmp_path / ".trash"
    write_log(tmp_path / "old.mcap")
    catalogue.delete("old")
    command = [sys.executable, "-m", "tests.recorder.writing.writing_process", str(tmp_path / "now.mcap")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, cwd=ROOT) as process:
        assert process.stdout is not None
        while int(process.stdout.readline()) < 1:
            pass
        assert catalogue.entry("now").state is LogState.WRITING
        with pytest.raises(StillRecordingError, match="recording now is still being written"):
            catalogue.delete("now")
        (tmp_path / "now.mcap").rename(trash / "now.mcap")  # as a hand does it
        assert catalogue.purge().recordings == 1
        assert [log.name for log in trash.glob("*.mcap")] == ["now.mcap"]
        process.kill()
    assert catalogue.entry("now").state is LogState.UNFINISHED
    assert catalogue.purge().recordings == 1
