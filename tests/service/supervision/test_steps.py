"""One step from every situation towards the wanted one, and the state that follows from the cameras; as tables."""

from dataclasses import replace
from itertools import product

import pytest

from rig.api.status import State
from service.processes.seen import Processes, Seen
from service.supervision.arming import state_by_cameras
from service.supervision.messages import Effect, RestartRecorder, SetUp, TakeDown, TurnBegins
from service.supervision.situation import Situation
from tests.service.supervision.situations import AT, HERE, recording, situation, told

_YES_NO = (False, True)


def _seen(processes: Processes, *, busy: bool, empty: bool) -> Seen:
    return Seen(processes, busy, empty, None if processes is Processes.NONE else (HERE,))


def _situation(
    state: State, wanted: bool, in_progress: bool, processes: Processes, busy: bool, empty: bool, may_try: bool
) -> Situation:
    now = situation(state, wanted=wanted, seen=_seen(processes, busy=busy, empty=empty))
    again_at = AT.s - 1 if may_try else AT.s + 1
    current = recording() if in_progress else None
    return replace(
        now,
        fault=replace(now.fault, again_at=again_at),
        recordings=replace(now.recordings, current=current),
    )


#: All that can be; processes that run are left to stop.
SITUATIONS = [
    _situation(state, wanted, in_progress, processes, busy, empty, may_try)
    for state, wanted, in_progress, processes, busy, empty, may_try in product(
        State, _YES_NO, _YES_NO, Processes, _YES_NO, _YES_NO, _YES_NO
    )
    if not (empty and (busy or processes is not Processes.NONE))
    and not (in_progress and state in {State.IDLE, State.DISARMING})
    and not (not in_progress and state is State.RECORDING)
    and not (wanted and state in {State.DISARMING, State.RECORDING} and processes is not Processes.ALL)
]
_STARTS = SetUp | RestartRecorder


def _steps(now: Situation) -> tuple[Situation, list[Effect]]:
    return told(now, TurnBegins())


def test_nothing_is_started_or_stopped_while_that_goes_on() -> None:
    for now in SITUATIONS:
        if now.seen.busy:
            assert not any(isinstance(effect, _STARTS | TakeDown) for effect in _steps(now)[1]), now


def test_a_recording_in_progress_is_never_disarmed() -> None:
    for now in SITUATIONS:
        if now.recordings.current is not None and not now.goal.armed:
            after, effects = _steps(now)
            assert (after.state, effects) == (now.state, []), now


def test_nothing_is_started_before_it_is_time_or_when_nobody_wants_it() -> None:
    for now in SITUATIONS:
        if now.fault.again_at > AT.s or not now.goal.armed:
            after, effects = _steps(now)
            assert not any(isinstance(effect, _STARTS) for effect in effects), now
            assert after.state is now.state or after.state is not State.ARMING, now


@pytest.mark.parametrize("wanted", _YES_NO)
def test_every_situation_leads_to_the_wanted_one(wanted: bool) -> None:
    """What is begun is done at the next turn; then all processes run, or none and the state is idle."""
    for begin in SITUATIONS:
        if begin.goal.armed is not wanted or begin.recordings.current is not None:
            continue
        if wanted and begin.state is State.DISARMING:
            continue  # nobody may arm then
        processes = begin.seen.processes
        now = replace(
            begin,
            seen=_seen(processes, busy=False, empty=processes is Processes.NONE),
            fault=replace(begin.fault, again_at=0.0),
        )
        for _ in range(3):
            after, effects = _steps(now)
            for effect in effects:
                if isinstance(effect, _STARTS):
                    after = replace(after, seen=_seen(Processes.ALL, busy=False, empty=False))
                elif isinstance(effect, TakeDown):
                    after = replace(after, seen=_seen(Processes.NONE, busy=False, empty=True))
            now = after
        assert _steps(now)[1] == []
        assert now.seen.processes is Processes.ALL if wanted else now.state is State.IDLE


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
