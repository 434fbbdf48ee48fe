"""A whole jump of which the worker did not get all pulses."""

from typing import Any

import numpy as np

from analysis.cameras.oriented_scene import OrientedScene
from analysis.worker.findings import MeasuredJump
from analysis.worker.whole_jump import JumpTask
from tests.analysis.simulated import simulated_measurements, true_cameras, true_jump


def _computed(every: int) -> MeasuredJump:
    """A simulated jump of which one in `every` pulses came."""
    system = true_cameras()
    measured = simulated_measurements(true_jump(3), system, np.random.default_rng(3))
    unused: Any = None  # what would look at images
    scene = OrientedScene(system, {}, unused, {}, {}, ())
    task = JumpTask("log", 1, measured.rate_hz, measured.cameras, (), scene, unused)
    return task.computed_of(measured.jumps[0].pulses[::every])


def test_pulses_that_did_not_come_have_entries_and_are_told() -> None:
    jump = _computed(2).result.jumps[0]
    numbers = [pulse.pulse for pulse in jump.pulses]
    assert numbers == list(range(numbers[0], numbers[-1] + 1))
    assert all(point is None for point in jump.pulses[1].raw.points.values())
    assert jump.pulses[1].smoothed is not None
    assert f"{len(numbers) // 2} of its {len(numbers)} pulses did not come to this worker" in jump.verdict.message


def test_of_a_jump_that_came_whole_nothing_is_said() -> None:
    assert "did not come" not in _computed(1).summary.verdict


def test_a_live_jump_is_never_measured_well_but_says_how_much_of_it_was_seen() -> None:
    whole, half = _computed(1).summary, _computed(2).summary
    count = len(_computed(1).result.jumps[0].pulses)
    assert whole.live
    assert not whole.ok
    assert whole.verdict == f"measured live, in {count} of its {count} pulses; what was measured well, the log tells"
    assert half.verdict.startswith(f"measured live, in {-(-count // 2)} of its ")
    assert "measured well:" not in half.verdict
    assert [each.code for each in whole.said] == ["jump_live", "jump_live_waits"]
    assert half.said[0].code == "jump_live"
    assert half.said[-1].code == "jump_incomplete"
