"""Commands whose input is named by mistake: a pipe that nobody fills, a log larger than memory."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from analysis.result.file import read
from analysis.scene.survey import read_survey
from photogrammetry.exchange.columns import read_survey_csv
from photogrammetry.network.calibration_file import read_calibration
from photogrammetry.network.file import read_network
from rig.errors import BadInputError
from tests.support.commands import run_svev


@pytest.mark.timeout(20)
@pytest.mark.parametrize("reader", [read_network, read_survey, read_calibration, read_survey_csv, read])
def test_no_reader_waits_for_a_pipe_or_reads_a_log(tmp_path: Path, reader: Callable[[Path], object]) -> None:
    path = tmp_path / "pipe.csv"
    os.mkfifo(path)
    with pytest.raises(BadInputError, match="is no file, but a device or a pipe"):
        reader(path)
    path.unlink()
    path.touch()
    os.truncate(path, 1 << 40)
    with pytest.raises(BadInputError, match="is larger than 100 MB") as refused:
        reader(path)
    assert "permissions" not in str(refused.value), "another file is what helps"


@pytest.mark.parametrize(
    "arguments",
    [
        ("adjust", "{}", "-o", "r.json"),
        ("plan", "{}"),
        ("orient", "{}", "-o", "r.json"),
        ("compare", "{}", "{}", "--out", "o"),
    ],
)
def test_commands_refuse_a_pipe_in_one_line(tmp_path: Path, arguments: tuple[str, ...]) -> None:
    os.mkfifo(tmp_path / "pipe.json")
    done = run_svev(*(each.format(tmp_path / "pipe.json") for each in arguments))
    assert done.returncode == 2, done
    assert "is no file, but a device or a pipe" in done.stderr
    assert "Traceback" not in done.stderr
