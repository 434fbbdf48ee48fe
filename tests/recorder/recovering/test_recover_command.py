"""`svev recover` as a user runs it: exit codes, one line per error, one JSON object."""

import json
from pathlib import Path

import pytest

from recorder.checking.verify import verify
from svev.cli import main
from tests.recorder.logs import ALL_OK, write_log


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / "log.mcap"
    write_log(path, (ALL_OK,) * 5)
    return path


def _recover(log: Path, *more: str) -> int:
    return main(["recover", str(log), "-o", str(log.with_name("new.mcap")), *more])


def test_an_unfinished_log_without_loss_is_no_error(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = log.read_bytes()
    log.write_bytes(data[: data.index(b"\x0f\x04\0\0\0\0\0\0\0")])  # up to the end of the data
    before = log.read_bytes()
    assert _recover(log) == 0
    out, err = capsys.readouterr()
    assert err == ""
    assert "5 pulses, 5 complete" in out
    assert "never closed: nobody knows whether pulses came after pulse 5" in out
    found = verify(log.with_name("new.mcap"))
    assert (found.verdict, found.ledger.complete) == ("partial", 5)
    assert found.ended_early == "it was never closed: nobody knows whether pulses came after pulse 5"
    assert log.read_bytes() == before


def test_loss_is_told_in_one_line_and_by_the_exit_code(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    data = bytearray(log.read_bytes())
    data[data.index(b"mono8") + 500] ^= 1
    log.write_bytes(data)
    assert _recover(log, "--json") == 3
    out, err = capsys.readouterr()
    result = json.loads(out)
    assert {key: result[key] for key in ("pulses", "complete", "partial", "causes", "lost_pixels", "lost_pulses")} == {
        "pulses": 5, "complete": 4, "partial": 1, "causes": {"lost": 0, "missed": 0, "damaged": 3, "absent": 0},
        "lost_pixels": [1], "lost_pulses": [],
    }  # fmt: skip
    assert (result["was_closed"], result["lossless"]) == (True, False)
    assert err.count("\n") == 1
    assert "but this is lost: the images of pulses 1" in err
    assert verify(log.with_name("new.mcap")).verdict == "partial"


def test_what_cannot_be_recovered_is_bad_input(log: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert _recover(log) == 0
    assert _recover(log) == 2
    assert "exists already" in capsys.readouterr().err
    log.with_name("new.mcap").unlink()
    log.write_bytes(b"nothing")
    assert _recover(log) == 2
    assert "no pulse of a log of svev can be read" in capsys.readouterr().err
    log.unlink()
    assert _recover(log) == 2
    assert "no such file" in capsys.readouterr().err
    assert not log.with_name("new.mcap").exists()
