"""The state machine: which state may follow which, and that threads always see a state with its own beginning."""

import threading
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rig.api.status import State
from service.supervision.state_machine import FOLLOWS, StateMachine


@given(st.lists(st.sampled_from(State), max_size=30))
def test_only_what_the_table_allows_happens_and_all_of_it_is_told(wishes: list[State]) -> None:
    moves: list[tuple[State, State]] = []
    machine = StateMachine(lambda before, to: moves.append((before, to)))
    expected = [State.IDLE]
    for wish in wishes:
        if wish in FOLLOWS[expected[-1]]:
            machine.move(wish)
            expected.append(wish)
        else:
            with pytest.raises(ValueError, match=f"{wish} cannot follow {expected[-1]}"):
                machine.move(wish)
        assert machine.state is expected[-1]
    assert moves == list(pairwise(expected))


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
    machine = StateMachine(lambda *_: None)
    seen: dict[object, State] = {}
    torn: list[object] = []
    over = threading.Event()

    def read() -> None:
        while not over.is_set():
            phase = machine.phase
            if seen.setdefault(phase.since, phase.state) is not phase.state:
                torn.append(phase)

    readers = [threading.Thread(target=read) for _ in range(3)]
    for reader in readers:
        reader.start()
    for _ in range(300):
        for state in (State.ARMING, State.ARMED, State.DISARMING, State.IDLE):
            machine.move(state)
    over.set()
    for reader in readers:
        reader.join(10)
    assert not torn
