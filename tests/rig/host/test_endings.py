"""Signals that end a program are counted: a second one of a person says that he does not wait."""

import signal

import pytest

from rig.host.endings import counted_endings

INT, TERM, HUP = signal.SIGINT, signal.SIGTERM, signal.SIGHUP


@pytest.mark.parametrize(
    ("came", "asks"),
    [([], 0), ([INT], 1), ([INT, INT], 2), ([TERM, INT], 2), ([HUP, HUP, HUP], 1), ([INT, HUP], 1), ([HUP, INT], 2)],
)
def test_a_closed_terminal_asks_once_however_often_it_is_told(came: list[signal.Signals], asks: int) -> None:
    """The kernel sends SIGHUP to the programs in front, and a shell to all of its own: both reach a recording."""
    before = [signal.getsignal(each) for each in (INT, TERM, HUP)]
    with counted_endings() as asked:
        for each in came:
            signal.raise_signal(each)
        assert asked() == asks
    assert [signal.getsignal(each) for each in (INT, TERM, HUP)] == before
