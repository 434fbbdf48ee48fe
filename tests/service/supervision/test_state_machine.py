"""The states: which may follow which, and that threads always see a state with its own beginning."""

import threading

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.api.status import State
from rig.events import Level
from service.supervision.messages import Effect, Say
from service.supervision.phases import FOLLOWS, move
from service.supervision.situation import Moment
from tests.service.supervision.situations import AT, situation


@given(st.lists(st.sampled_from(State), max_size=30))
def test_only_what_the_table_allows_happens_and_all_of_it_is_told(wishes: list[State]) -> None:
    effects: list[Effect] = []
    now, moves = situation(State.IDLE), 0
    for wish in wishes:
        before = now
        if wish in FOLLOWS[before.state]:
            now, moves = move(before, wish, AT, effects.append), moves + 1
            assert (now.state, now.phase.number) == (wish, before.phase.number + 1)
        else:
            with pytest.raises(ValueError, match=f"{wish} cannot follow {before.state}"):
                move(before, wish, AT, effects.append)
    assert len(effects) == moves
    assert all(isinstance(effect, Say) and effect.name == "service" for effect in effects)
    levels = {Level.INFO, *({Level.ERROR} if State.FAULT in wishes else ())}
    assert {effect.level for effect in effects if isinstance(effect, Say)} <= levels


def test_every_state_is_reached_from_idle_and_leads_back_to_it() -> None:
    def reached(start: State) -> set[State]:
        seen, todo = {start}, [start]
        while todo:
            fresh = FOLLOWS[todo.pop()] - seen
            seen |= fresh
            todo += fresh
        return seen

    assert reached(State.IDLE) == set(State)
    assert all(State.IDLE in reached(state) for state in State)


def test_readers_never_see_a_state_with_another_ones_beginning() -> None:
    """A situation is replaced as a whole, so whoever reads one has what belongs together."""
    now = [situation(State.IDLE)]
    seen: dict[object, State] = {}
    torn: list[object] = []
    over = threading.Event()

    def read() -> None:
        while not over.is_set():
            phase = now[0].phase
            if seen.setdefault(phase.number, phase.state) is not phase.state:
                torn.append(phase)

    readers = [threading.Thread(target=read) for _ in range(3)]
    for reader in readers:
        reader.start()
    for _ in range(300):
        for state in (State.ARMING, State.ARMED, State.DISARMING, State.IDLE):
            now[0] = move(now[0], state, Moment.now(), lambda _: None)
    over.set()
    for reader in readers:
        reader.join(10)
    assert not torn
