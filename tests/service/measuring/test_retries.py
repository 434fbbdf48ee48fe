"""What survey or poses kept from being measured is measured again when their file changes."""

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from rig.api.measuring import MeasuringState
from rig.api.statement import Level, Statement
from rig.settings.model import AnalysisSettings
from service.measuring.keeping import keep_problem
from service.measuring.results import failed_by
from service.measuring.retries import Retries, source_mark
from simrig.world.survey import survey
from tests.analysis.simulated import training
from tests.recorder.logs import write_log
from tests.service.measuring.test_queue import Bench, bench, hill
from tests.support.rigs import SIM
from tests.support.waiting import wait_until

__all__ = ["bench", "hill"]

WRONG = Statement(level=Level.WARNING, code="", text="it cannot be measured")


@pytest.fixture
def content() -> dict[str, Any]:
    """A survey."""
    found: dict[str, Any] = survey(training())
    return found


def test_what_failed_by_the_survey_is_due_once_when_another_one_can_be_read(
    tmp_path: Path, content: dict[str, Any]
) -> None:
    path = tmp_path / "hill.json"
    analysis = AnalysisSettings(survey=path)
    rig = SIM.model_copy(update={"analysis": analysis})
    retries = Retries(tmp_path, lambda: rig)
    for recording in ("a", "b", "c", "never"):
        write_log(tmp_path / f"{recording}.mcap")
    for recording in ("a", "b"):
        keep_problem(tmp_path / f"{recording}.mcap", WRONG, source_mark(analysis))  # there is no file
    keep_problem(tmp_path / "c.mcap", WRONG)
    assert retries.due() == []
    path.write_text("{")
    assert retries.due() == []  # cannot be read
    path.write_text(json.dumps(content))
    assert retries.due() == ["b", "a"]
    retries.queued(["b", "a"])
    assert retries.due() == []
    assert Retries(tmp_path, lambda: rig).due() == []  # nor for a service that starts again
    keep_problem(tmp_path / "a.mcap", WRONG, source_mark(analysis))
    retries.look_again()
    assert retries.due() == []
    path.write_text(json.dumps(content, indent=1))
    assert retries.due() == ["b", "a"]
    path.unlink()
    assert retries.due() == []


def test_a_change_while_the_log_is_being_measured_is_not_overlooked(tmp_path: Path, content: dict[str, Any]) -> None:
    path = tmp_path / "hill.json"
    analysis = AnalysisSettings(survey=path)
    retries = Retries(tmp_path, lambda: SIM.model_copy(update={"analysis": analysis}))
    write_log(tmp_path / "a.mcap")
    before = source_mark(analysis)
    path.write_text(json.dumps(content))
    assert retries.due() == []
    keep_problem(tmp_path / "a.mcap", WRONG, before)
    retries.look_again()
    assert retries.due() == ["a"]


@pytest.mark.long
@pytest.mark.alone
def test_a_survey_that_comes_late_measures_the_jumps_of_before_by_itself(bench: Bench) -> None:
    right, bench.survey = bench.survey, bench.folder / "late.json"
    assert right is not None
    (bench.folder / "spoilt.mcap").write_bytes(b"no log")
    with bench.running() as queue:
        queue.opened(bench.log("spoilt"))
        queue.opened(bench.log("jump"))
        failed = bench.until_over(queue, "jump")
        assert (failed.state, failed.again) == (MeasuringState.FAILED, True)
        assert bench.until_over(queue, "spoilt").again
        bench.busy = True
        shutil.copy(right, bench.survey)
        wait_until(lambda: bench.waiting() == ["spoilt", "jump"], "both wait")
        assert bench.of(queue, "jump").state is MeasuringState.WAITING
        bench.busy = False
        wait_until(lambda: not bench.waiting(), "both have been tried", 120)
        done, spoilt = bench.of(queue, "jump"), bench.of(queue, "spoilt")
    assert (done.state, done.again, failed_by(bench.log("jump"))) == (MeasuringState.DONE, False, None), done.problem
    assert (spoilt.state, spoilt.again) == (MeasuringState.FAILED, False)
    again = "survey or poses have changed: 2 recordings that could not be measured by them are measured again"
    assert bench.said.count(again) == 1
