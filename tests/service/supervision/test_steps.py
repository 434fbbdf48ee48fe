"""The steps from every situation to the wanted one, and the state that follows from the cameras; as tables."""

from dataclasses import replace
from itertools import product

import pytest

from rig.api.status import State
from service.supervision.state_machine import FOLLOWS, Processes, Situation, Step, next_steps, state_by_cameras

_YES_NO = (False, True)
#: All that can be; processes that run are left to stop.
SITUATIONS = [
    Situation(state, wanted, recording, processes, busy, empty, may_try)
    for state, wanted, recording, processes, busy, empty, may_try in product(
        State, _YES_NO, _YES_NO, Processes, _YES_NO, _YES_NO, _YES_NO
    )
    if not (empty and (busy or processes is not Processes.NONE))
]
_STARTS = {Step.START_ALL, Step.START_RECORDER}
_MOVES = {Step.BEGIN_DISARMING: State.DISARMING, Step.REST: State.IDLE, Step.BEGIN_ARMING: State.ARMING}


def _after(now: Situation, step: Step) -> Situation:
    """The situation after a step, and after all that it began is done."""
    match step:
        case Step.BEGIN_DISARMING | Step.REST | Step.BEGIN_ARMING:
            return replace(now, state=_MOVES[step])
        case Step.STOP_ALL:
            return replace(now, processes=Processes.NONE, empty=True)
        case Step.START_ALL | Step.START_RECORDER:
            return replace(now, processes=Processes.ALL, empty=False)


def test_nothing_is_started_or_stopped_while_that_goes_on() -> None:
    for now in SITUATIONS:
        if now.busy:
            assert not {*next_steps(now)} & {*_STARTS, Step.STOP_ALL}, now


def test_a_recording_in_progress_is_never_disarmed() -> None:
    assert all(not next_steps(now) for now in SITUATIONS if now.recording and not now.wanted)


def test_nothing_is_started_before_it_is_time_or_when_nobody_wants_it() -> None:
    for now in SITUATIONS:
        if not now.may_try or not now.wanted:
            assert not {*next_steps(now)} & {*_STARTS, Step.BEGIN_ARMING}, now


@pytest.mark.parametrize("wanted", _YES_NO)
def test_every_situation_leads_to_the_wanted_one(wanted: bool) -> None:
    """What is begun is done at the next turn; then all processes run, or none and the state is idle."""
    for begin in SITUATIONS:
        if begin.wanted is not wanted or begin.recording or begin.state is State.RECORDING:
            continue
        if begin.wanted and begin.state is State.DISARMING:
            continue  # nobody may arm then
        now = replace(begin, busy=False, may_try=True, empty=begin.processes is Processes.NONE)
        for _ in range(3):
            for step in next_steps(now):
                to = _MOVES.get(step, now.state)
                assert to is now.state or to in FOLLOWS[now.state], (now, step)
                now = _after(now, step)
        assert next_steps(now) == ()
        assert now.processes is Processes.ALL if wanted else now.state is State.IDLE


@pytest.mark.parametrize(
    ("state", "settled", "able", "any_present", "to"),
    [
        (State.ARMING, False, True, True, State.ARMING),
        (State.ARMING, False, False, False, State.ARMING),
        (State.ARMING, True, True, True, State.ARMED),
        (State.ARMING, True, False, True, State.FAULT),
        (State.ARMED, True, True, True, State.ARMED),
        (State.ARMED, True, False, True, State.ARMED),  # one camera went: the others go on
        (State.ARMED, True, False, False, State.FAULT),
        (State.FAULT, True, True, True, State.ARMED),
        (State.FAULT, True, False, False, State.FAULT),
        (State.RECORDING, True, False, False, State.RECORDING),
        (State.DISARMING, True, True, True, State.DISARMING),
        (State.IDLE, True, True, True, State.IDLE),
    ],
)
def test_the_cameras_decide_between_armed_and_fault(
    state: State, settled: bool, able: bool, any_present: bool, to: State
) -> None:
    assert state_by_cameras(state, settled=settled, able=able, any_present=any_present) is to
