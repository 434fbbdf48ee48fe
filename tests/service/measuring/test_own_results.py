"""A result that a person has written beside a log is like one of the service."""

import shutil
from contextlib import closing
from pathlib import Path

import pytest

from recorder.catalogue.folder import Catalogue
from recorder.log.beside import measured_path
from rig.api.athletes import JumpQuery
from rig.api.measuring import MeasuringState
from rig.api.recordings import RecordingQuery
from service.measuring.results import measurement_of
from service.recordings.measured_jumps import LogJudge, MeasuredJumps
from tests.analysis.measured import measured_jump
from tests.support.commands import run_svev


@pytest.mark.long
def test_what_svev_analyze_writes_beside_a_log_is_listed_and_found(tmp_path: Path) -> None:
    jump = measured_jump()
    log = Path(shutil.copy(jump.log.path, tmp_path))
    query = RecordingQuery(search="takeoff > 10")
    with closing(Catalogue(tmp_path, LogJudge())) as catalogue:
        assert catalogue.find(query).total == 0
        command = ["analyze", log, "--survey", jump.log.survey, "--measurements", jump.result / "measurements.json"]
        done = run_svev(*map(str, command), "--out", str(measured_path(log)), timeout_s=170)
        assert done.returncode == 0, done.stderr
        assert [entry.id for entry in catalogue.find(query).entries] == [log.stem]
        (found,) = MeasuredJumps(catalogue).find(JumpQuery())
    assert found.jump.ok
    told = measurement_of(log.stem, log)
    assert (told.state, told.renaming) == (MeasuringState.DONE, False)
    assert "report.html" in told.files
