import threading
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from rig.errors import BadInputError
from rig.pulse import HillPulse
from simrig.world.faults import Fault, FaultKind, FaultPlan


def missed(at_pulse: int | None = None, count: int = 1) -> Fault:
    return Fault(kind=FaultKind.MISSED_PULSE, camera="K1", at_pulse=at_pulse, count=count)


@given(st.lists(st.tuples(st.integers(0, 40), st.integers(1, 5)), max_size=8))
def test_every_fault_hits_its_pulses_and_no_other(spans: list[tuple[int, int]]) -> None:
    plan = FaultPlan(missed(first, count) for first, count in spans)
    for pulse in range(50):
        assert len(plan.take(HillPulse(pulse))) == sum(first <= pulse < first + count for first, count in spans)


def test_an_injected_fault_hits_the_next_pulses() -> None:
    plan = FaultPlan()
    assert plan.take(HillPulse(7)) == ()
    plan.inject(missed(count=2))
    assert [len(plan.take(HillPulse(pulse))) for pulse in (8, 9, 10)] == [1, 1, 0]


def test_the_taken_fault_says_which_pulse_it_hit() -> None:
    plan = FaultPlan([missed()])
    (fault,) = plan.take(HillPulse(31))
    assert fault.at_pulse == 31


def test_a_fault_that_a_camera_slept_through_is_forgotten() -> None:
    plan = FaultPlan([missed(5), missed(20)])
    assert plan.take(HillPulse(10)) == ()
    assert len(plan.take(HillPulse(20))) == 1


def test_a_late_start_gets_the_rest_of_a_series() -> None:
    plan = FaultPlan([missed(5, count=10)])
    assert [len(plan.take(HillPulse(pulse))) for pulse in (12, 14, 15)] == [1, 1, 0]


def test_the_past_cannot_be_injected() -> None:
    plan = FaultPlan()
    plan.take(HillPulse(100))
    with pytest.raises(BadInputError, match="name a later one"):
        plan.inject(missed(100))
    plan.inject(missed(101))
    assert len(plan.take(HillPulse(101))) == 1


def test_injecting_from_many_threads_loses_nothing() -> None:
    plan = FaultPlan()

    def inject_many() -> None:
        for _ in range(200):
            plan.inject(missed())

    threads = [threading.Thread(target=inject_many) for _ in range(4)]
    for thread in threads:
        thread.start()
    taken, pulse = 0, 0
    while any(thread.is_alive() for thread in threads):
        taken += len(plan.take(HillPulse(pulse)))
        pulse += 1
    for thread in threads:
        thread.join(10)
    assert taken + len(plan.take(HillPulse(pulse))) == 800


@pytest.mark.parametrize(
    ("fields", "word"),
    [
        ({"kind": "lost_packets"}, "needs packets"),
        ({"kind": "lost_packets", "packets": [0]}, "use lost_leader"),
        ({"kind": "missed_pulse", "packets": [3]}, "has no packets"),
        ({"kind": "frozen"}, "needs duration_s"),
        ({"kind": "lost_frame", "duration_s": 1.0}, "has no duration_s"),
        ({"kind": "slow_link", "duration_s": 1.0}, "needs mbit_s"),
        ({"kind": "restart", "duration_s": 1.0, "count": 2}, "remove count"),
        ({"kind": "sunburn"}, "kind"),
        ({"kind": "missed_pulse", "at": 3}, "Extra inputs"),
    ],
)
def test_a_fault_that_makes_no_sense_is_refused(fields: dict[str, Any], word: str) -> None:
    with pytest.raises(ValidationError, match=word):
        Fault.model_validate({"camera": "K1", **fields})
