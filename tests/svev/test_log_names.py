"""Logs, films and folders whose names are no UTF-8: logs are made of them, and tell the names with escapes."""

import json
import os
from pathlib import Path

import pytest

from recorder.checking.verify import verify
from recorder.reading.log_reader import LogReader
from rig.frame import FrameStatus
from rig.topics import IMPORT_METADATA, MERGE_METADATA, RECOVERY_METADATA
from svev.cli import main
from tests.recorder.importing.films import write_folder
from tests.recorder.logs import ALL_OK, write_log
from tests.recorder.merging.test_merge import write_part

NAME, SHOWN = os.fsdecode(b"sted-\xe5"), r"sted-\xe5"


def test_a_log_that_is_cut_off_is_recovered(tmp_path: Path) -> None:
    cut, out = tmp_path / f"{NAME}.mcap", tmp_path / "out.mcap"
    write_log(tmp_path / "log.mcap", (ALL_OK,) * 6)
    data = (tmp_path / "log.mcap").read_bytes()
    cut.write_bytes(data[: len(data) * 2 // 3])
    main(["recover", str(cut), "-o", str(out)])
    assert verify(out).ledger.pulses
    with LogReader(out) as reader:
        list(reader.messages("/events"))
        assert reader.metadata[RECOVERY_METADATA]["source"] == f"{SHOWN}.mcap"


def test_logs_are_merged(tmp_path: Path) -> None:
    one, two, out = (tmp_path / f"{NAME}-{which}.mcap" for which in ("a", "b", "ab"))
    for path, camera in ((one, "K1"), (two, "K2")):
        write_part(tmp_path / "part.mcap", [camera], range(40))
        (tmp_path / "part.mcap").rename(path)
    assert main(["merge", str(one), str(two), "-o", str(out)]) == 0
    assert {status for run in verify(out).ledger.failed.runs for _, status in run.cameras} <= {FrameStatus.ABSENT}
    with LogReader(out) as reader:
        list(reader.messages("/events"))
        assert reader.metadata[MERGE_METADATA]["source_1"] == f"{SHOWN}-a.mcap"


def test_films_are_imported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    films = [write_folder(tmp_path / which, range(1, 5)).rename(tmp_path / f"{NAME}-{which}") for which in "ab"]
    out = tmp_path / f"{NAME}.mcap"
    assert main(["import", *map(str, films), "-o", str(out), "--rate", "50", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["pulses"] == 4
    assert main(["verify", str(out)]) == 0
    assert main(["info", str(out)]) == 0
    with LogReader(out) as reader:
        list(reader.messages("/events"))
        assert reader.metadata[IMPORT_METADATA]["source_1"] == f"{SHOWN}-a"
