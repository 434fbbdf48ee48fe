"""Marks are kept action by action: whatever is done, undone and done again, and whenever the program is killed."""

import os
import signal
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from analysis.digitizing.marks.journal import SUFFIX, Entered, Journal, Key, operators
from analysis.digitizing.marks.session import Session
from rig.api.digitizing import Action, MarkState, PlaceAction, RemoveAction, StateAction, UndoAction
from rig.errors import BadInputError
from rig.transport.launcher import start_program

_WRITER = "tests.analysis.digitizing.marks.writer"
_HEAD = b'{"format": "svev-digitizing/1", "recording": "jump-1", "operator": "Anna"}\n'
_places = st.tuples(st.floats(0, 640), st.floats(0, 480))
_where = {"pulse": st.integers(1, 3), "camera": st.sampled_from(["K1", "K2"])}
_points = st.sampled_from(["P1", "ball:B7"])
_actions: st.SearchStrategy[Action] = st.one_of(
    st.builds(PlaceAction, do=st.just("place"), thing=_points, xy=_places, **_where),
    st.builds(PlaceAction, do=st.just("place"), thing=st.just("right ski"), xy=_places, **_where),
    st.builds(StateAction, do=st.just("state"), thing=st.sampled_from(["P1", "right ski"]),
              state=st.sampled_from([MarkState.HIDDEN, MarkState.NOT_VISIBLE]), **_where),
    st.builds(RemoveAction, do=st.just("remove"), thing=st.sampled_from(["P1", "right ski"]), **_where),
    st.builds(RemoveAction, do=st.just("remove"), thing=st.just("right ski"), vertex=st.just(0), **_where),
    st.builds(UndoAction, do=st.sampled_from(["undo", "redo"])),
)  # fmt: skip


def opened(folder: Path, operator: str = "Anna") -> Session:
    """The session of an operator."""
    return Session(Journal(folder / f"{operator}{SUFFIX}", "jump-1", operator))


@given(actions=st.lists(_actions, max_size=30))
@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
def test_undo_and_redo_give_back_every_state_and_so_does_reading_the_file_again(
    tmp_path: Path, actions: list[Action]
) -> None:
    path = tmp_path / f"Anna{SUFFIX}"
    path.unlink(missing_ok=True)
    session = opened(tmp_path)
    past: list[object] = []
    future: list[object] = []
    current: object = []
    for action in actions:
        before = session.revision
        session.act(action)
        if isinstance(action, UndoAction):
            source, target = (past, future) if action.do == "undo" else (future, past)
            if source:
                target.append(current)
                current = source.pop()
            assert session.everything() == current
        elif session.revision > before:
            past.append(current)
            future.clear()
            current = session.everything()
        assert (session.undo_depth, session.redo_depth) == (len(past), len(future))
    now, coverage = session.everything(), session.coverage()
    session.close()
    read = opened(tmp_path)
    assert read.everything() == now
    assert {k: v for k, v in read.coverage().items() if v} == {k: v for k, v in coverage.items() if v}
    assert (read.undo_depth, read.redo_depth, read.revision) == (
        session.undo_depth,
        session.redo_depth,
        session.revision,
    )
    read.close()


def test_vertices_of_a_line_are_counted_in_order(tmp_path: Path) -> None:
    session = opened(tmp_path)
    for x in (1.0, 2.0, 3.0):
        session.act(PlaceAction(do="place", pulse=1, camera="K1", thing="right ski", xy=(x, 0.0)))
    session.act(RemoveAction(do="remove", pulse=1, camera="K1", thing="right ski", vertex=1))
    assert [(key.vertex, mark.xy) for key, mark in session.everything()] == [(0, (1.0, 0.0)), (1, (3.0, 0.0))]
    with pytest.raises(BadInputError, match="has 2 points here: the next one has the number 2"):
        session.act(PlaceAction(do="place", pulse=1, camera="K1", thing="right ski", xy=(9.0, 0.0), vertex=5))
    with pytest.raises(BadInputError, match="P1 is no line"):
        session.act(PlaceAction(do="place", pulse=1, camera="K1", thing="P1", xy=(9.0, 0.0), vertex=0))
    session.act(StateAction(do="state", pulse=1, camera="K1", thing="right ski", state="hidden"))
    assert [mark.state for _, mark in session.everything()] == [MarkState.HIDDEN]
    session.close()


def test_a_second_program_is_refused_until_the_first_one_ends(tmp_path: Path) -> None:
    first = PlaceAction(do="place", pulse=1, camera="K1", thing="P1", xy=(1.0, 2.0))
    session, late, other = opened(tmp_path), opened(tmp_path), opened(tmp_path, "Bo")
    assert operators(tmp_path) == []
    session.act(first)
    other.act(first)
    with pytest.raises(BadInputError, match="another program measures under this name now"):
        opened(tmp_path)
    with pytest.raises(BadInputError, match="another program measures under this name now"):
        late.act(first)
    session.close()
    with pytest.raises(BadInputError, match="somebody has measured under this name meanwhile"):
        late.act(first)
    again = opened(tmp_path)
    assert len(again.everything()) == 1
    again.close()
    other.close()
    assert operators(tmp_path) == ["Anna", "Bo"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            b'{"format": "svev-digitizing/1", "recording": "jump-2", "operator": "Anna"}\n',
            "belongs to recording jump-2",
        ),
        (b"P1;1;2\n", "is no journal of marks"),
        (_HEAD + b"nonsense\n", "is no journal"),
    ],
)
def test_a_file_that_is_something_else_is_refused_and_left_as_it_is(tmp_path: Path, text: bytes, said: str) -> None:
    path = tmp_path / f"Anna{SUFFIX}"
    path.write_bytes(text)
    with pytest.raises(BadInputError, match=said):
        opened(tmp_path)
    assert path.read_bytes() == text


def test_an_entry_that_was_cut_is_left_out_and_the_next_one_stands_in_its_place(tmp_path: Path) -> None:
    session = opened(tmp_path)
    for pulse in (1, 2):
        session.act(PlaceAction(do="place", pulse=pulse, camera="K1", thing="P1", xy=(1.0, 2.0)))
    session.close()
    path = tmp_path / f"Anna{SUFFIX}"
    path.write_bytes(path.read_bytes()[:-9])
    session = opened(tmp_path)
    assert [key.pulse for key, _ in session.everything()] == [1]
    session.act(PlaceAction(do="place", pulse=3, camera="K1", thing="P1", xy=(1.0, 2.0)))
    session.close()
    session = opened(tmp_path)
    assert [key.pulse for key, _ in session.everything()] == [1, 3]
    session.close()


@pytest.mark.long
def test_a_killed_program_loses_at_most_the_action_under_way(tmp_path: Path) -> None:
    last = -1
    for count in range(40):
        reading, writing = os.pipe()
        process = start_program(_WRITER, (str(tmp_path),), (), {}, own_group=False, output=(writing, 2))
        os.close(writing)
        with os.fdopen(reading) as told:
            for _ in range(3 + count % 7):
                last = int(told.readline())
            process.send_signal(signal.SIGKILL)
            last = int([str(last), *told.read().split()][-1])
        process.wait(20)
        session = opened(tmp_path)
        kept = [key.pulse for key, _ in session.everything()]
        session.close()
        assert kept == list(range(len(kept)))
        assert len(kept) - 1 in {last, last + 1}


def test_the_time_of_an_action_does_not_depend_on_how_much_is_marked(tmp_path: Path) -> None:
    session = opened(tmp_path)
    many = [(Key(pulse, "K1", "P1"), Entered(MarkState.MEASURED, (1.0, 2.0))) for pulse in range(50_000)]
    session.put(many)
    assert session.undo_depth == 1
    for pulse in range(10):
        session.act(PlaceAction(do="place", pulse=pulse, camera="K2", thing="P1", xy=(1.0, 2.0)))
        assert len(session.at(pulse)) == 2
    _, touched = session.changes(session.revision - 2, 0.0)
    assert [each.pulse for each in touched] == [8, 9]
    session.close()
