"""Signals by which a program is told to end, and those that reach every process of a group at once.

A signal that raises an exception may do so at any place, also where nothing clears up behind it. Programs with
processes of their own count the signals instead, and look at the count where they wait.
"""

import ctypes
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final

#: Ctrl-C, `kill` and systemd, and a terminal that is closed or an `ssh` that is dropped.
ENDINGS: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
#: A terminal sends them to its window, systemd to a session or a scope, `timeout` to the group of its program.
_OF_THE_GROUP: Final = (*ENDINGS, signal.SIGTSTP)
#: A person does not ask twice within so long: he would have to press Ctrl-C ten times a second. `timeout` sends its
#: signal to the program and at once again to the group of the program (timeout.c, GNU coreutils).
_ONE_WISH_S: Final = 0.1

_PR_SET_PDEATHSIG: Final = 1  # <linux/prctl.h>

#: Tells how often somebody has asked the program to end.
Asks = Callable[[], int]


@contextmanager
def counted_endings(signals: tuple[signal.Signals, ...] = ENDINGS) -> Iterator[Asks]:
    """Within, signals that end a program are counted only. One that `nohup` has switched off stays so.

    A terminal that is closed is one wish to end, however often it is told: by the kernel, by the shell, by both. So
    SIGHUP counts only if nothing has come before. Signals that come at once are one wish, too.

    Yields:
        A function that tells how often somebody has asked.
    """
    caught: list[float] = []

    def heard(number: int, _: object) -> None:
        now = time.monotonic()
        if not caught or (number != signal.SIGHUP and now - caught[-1] > _ONE_WISH_S):
            caught.append(now)

    wanted = [each for each in signals if each is not signal.SIGHUP or signal.getsignal(each) != signal.SIG_IGN]
    before = {number: signal.signal(number, heard) for number in wanted}
    try:
        yield lambda: len(caught)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def interrupted_by_endings() -> Iterator[None]:
    """Within, a closed terminal and `kill` do what Ctrl-C does: nothing half done is left behind.

    A signal that `nohup` has switched off stays so.
    """
    wanted = [number for number in ENDINGS if signal.getsignal(number) != signal.SIG_IGN]
    before = {number: signal.signal(number, signal.default_int_handler) for number in wanted}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def nobody_asks() -> int:
    """Nobody asks the program to end."""
    return 0


def heed(asks: Asks) -> None:
    """End what is being done if somebody has asked for it.

    Raises:
        KeyboardInterrupt: somebody has.
    """
    if asks():
        raise KeyboardInterrupt


def leave_signals_to_parent() -> None:
    """Ignore what reaches all processes of a group at once: the parent says what it means."""
    for number in _OF_THE_GROUP:
        signal.signal(number, signal.SIG_IGN)


def heed_signals_again() -> None:
    """Undo `leave_signals_to_parent`."""
    for number in _OF_THE_GROUP:
        signal.signal(number, signal.SIG_DFL)


def be_killed_with_parent() -> None:
    """Let the kernel kill this process, stopped (SIGSTOP) or not, as soon as the *thread* that started it ends."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
