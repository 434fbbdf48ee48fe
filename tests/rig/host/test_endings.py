"""Signals that end a program are counted: a second one of a person says that he does not wait."""

import signal

import pytest

from rig.host.endings import counted_endings
from tests.support.waiting import let_pass

INT, TERM, HUP = signal.SIGINT, signal.SIGTERM, signal.SIGHUP
LATER = None  #: a person has taken his time


@pytest.mark.parametrize(
    ("came", "asks"),
    [
        ([], 0), ([INT], 1), ([INT, LATER, INT], 2), ([TERM, LATER, INT], 2), ([HUP, LATER, HUP, HUP], 1),
        ([INT, LATER, HUP], 1), ([HUP, LATER, INT], 2), ([INT, INT], 1), ([TERM, HUP, TERM, LATER, TERM, TERM], 2),
    ],
)  # fmt: skip
def test_a_closed_terminal_and_signals_at_once_ask_once(came: list[signal.Signals | None], asks: int) -> None:
    """The kernel sends SIGHUP to the programs in front, and a shell to all of its own: both reach a recording.

    `timeout` sends its signal to a program, and at once to the group of the program.
    """
    before = [signal.getsignal(each) for each in (INT, TERM, HUP)]
    with counted_endings() as asked:
        for each in came:
            if each is LATER:
                let_pass(0.15)
            else:
                signal.raise_signal(each)
        assert asked() == asks
    assert [signal.getsignal(each) for each in (INT, TERM, HUP)] == before
