"""Jumps that are measured live are kept beside their log, go with it, and are known after a restart."""

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import pytest

from analysis.result import file as result_file
from analysis.result.model import MeasuredRecording
from analysis.worker.findings import MeasuredJump
from recorder.catalogue.folder import Catalogue
from recorder.log.beside import jumper_path
from rig.api.jump import LastJump
from rig.errors import StorageError
from rig.pulse import PulseNumber
from service.processes.live_jumps import keep
from service.recordings import live_results
from tests.analysis.result.recordings import recording
from tests.recorder.logs import write_log

LATER = 200  # pulses from one jump to the next


def measured(number: int, of: MeasuredRecording, name: str) -> MeasuredJump:
    jump = of.jumps[number - 1]
    summary = LastJump(
        recording=name, jump=1, time=datetime(2026, 1, number, tzinfo=UTC), ok=True, verdict=f"jump {number}"
    )
    return MeasuredJump(replace(of, recording=name, jumps=(jump,)), summary)


def test_jumps_of_a_recording_stand_beside_its_log_in_their_order(tmp_path: Path) -> None:
    log, two = tmp_path / "a.mcap", recording(jumps=2)
    later = tuple(replace(pulse, pulse=PulseNumber(pulse.pulse + LATER)) for pulse in two.jumps[1].pulses)
    two = replace(two, jumps=(two.jumps[0], replace(two.jumps[1], pulses=later)))
    assert keep(measured(1, two, "a"), [tmp_path]) is None, "its log was deleted"
    write_log(log)
    assert live_results.latest(tmp_path) is None
    for number in (2, 1, 2):  # the last one again, by an analysis that was started again
        assert keep(measured(number, two, "a"), [tmp_path / "other disk", tmp_path]) == jumper_path(log)
    assert [(jump.jump, jump.verdict) for jump in live_results.summaries(log)] == [(1, "jump 1"), (2, "jump 2")]
    kept = result_file.read(jumper_path(log))
    assert [jump.number for jump in kept.jumps] == [1, 2]
    assert [jump.pulses[0].pulse for jump in kept.jumps] == [jump.pulses[0].pulse for jump in two.jumps]
    assert live_results.latest(tmp_path) == live_results.summaries(log)[-1]


def test_the_file_goes_with_its_log_and_a_damaged_one_is_no_obstacle(tmp_path: Path) -> None:
    log, one = tmp_path / "a.mcap", recording(jumps=1)
    write_log(log)
    jumper_path(log).write_text("{", encoding="utf-8")
    assert live_results.latest(tmp_path) is None
    keep(measured(1, one, "a"), [tmp_path])
    assert len(live_results.summaries(log)) == 1
    Catalogue(tmp_path).delete("a")
    assert live_results.latest(tmp_path) is None


def test_a_disk_that_refuses_is_named(tmp_path: Path) -> None:
    write_log(tmp_path / "a.mcap")
    jumper_path(tmp_path / "a.mcap").mkdir()
    with pytest.raises(StorageError, match=r"a\.jumper\.json: cannot be written .*svev analyze"):
        keep(measured(1, recording(jumps=1), "a"), [tmp_path])
