"""Starts a program that does long work, tells it what to do, hears how far it is, and lets it stand still.

Standing still is SIGSTOP, so that it is at once, wherever the program is in its work.
"""

import os
import signal
import time
from collections.abc import Callable, Sequence
from typing import Any, Final

from rig.background.messages import End, Failed, Order, Ready
from rig.transport.process_table import Child, ProcessSpec

#: So long a program may go on after a recording has begun: two pulses at 100 Hz.
_LOOK_S: Final = 0.02
_NICE: Final = 19
#: One that gets only the processor time that nobody else wants needs some even to end.
_GONE_S: Final = 60.0


def run_child(
    module: str,
    order: Order,
    says: Any,
    *,
    busy: Callable[[], bool],
    wanted: Callable[[], bool],
    tell: Callable[[Any], None] = lambda _: None,
    hold: Callable[[bool], None] = lambda _: None,
    yielding: bool = True,
    inherited: Sequence[int] = (),
) -> End | None:
    """Run a program to its end.

    Args:
        module: its main module; its `main` calls `rig.background.program.serve`.
        order: what it is to do.
        says: type of its messages, or union of them, beside those that all programs say.
        busy: whether it has to stand still at present; asked often, so it is to be quick.
        wanted: whether anybody still wants what it does.
        tell: takes what it says before its end.
        hold: called with True when it has to stand still from now on, with False when it goes on.
        yielding: whether it takes only the processor time that nobody else wants; False where nothing is recorded.
        inherited: descriptors that it has too, by the same numbers.

    Returns:
        What it has come to; None if it was ended because nobody wants it any more.

    Raises:
        OSError: it cannot be started, or has ended by itself.
    """
    brake = _Brake(busy, hold)
    while brake.look() and wanted():
        time.sleep(_LOOK_S)
    if not wanted():
        return None
    name = module.rpartition(".")[2]
    child = Child(ProcessSpec(name, module, order, inherit=tuple(inherited), reports=Ready | Failed | says))
    try:
        if yielding:  # while it has one thread: those that its libraries start are like it
            os.setpriority(os.PRIO_PROCESS, child.pid, _NICE)
            os.sched_setscheduler(child.pid, os.SCHED_IDLE, os.sched_param(0))
        return _followed(child, brake, wanted, tell)
    finally:
        child.kill(_GONE_S)


class _Brake:
    """Tells whether the work has to stand still, and says so when that changes."""

    def __init__(self, busy: Callable[[], bool], hold: Callable[[bool], None]) -> None:
        self._busy, self._hold, self._on = busy, hold, False

    def look(self) -> bool:
        """Whether it has to stand still now."""
        if self._busy() != self._on:
            self._on = not self._on
            self._hold(self._on)
        return self._on


def _followed(child: Child, brake: _Brake, wanted: Callable[[], bool], tell: Callable[[Any], None]) -> End | None:
    ready = stopped = False
    while wanted():
        if ready and brake.look() != stopped:
            stopped = not stopped
            child.send_signal(signal.SIGSTOP if stopped else signal.SIGCONT)
        for message in child.control.receive(_LOOK_S):
            match message:
                case Ready():
                    ready = True
                case End():
                    return message
                case _:
                    tell(message)
        if child.control.ended:
            raise ChildProcessError(0, "the program has ended by itself")
    return None
