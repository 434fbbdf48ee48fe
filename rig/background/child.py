"""Starts such a program, tells it what to do, and hears how far it is, by lines of JSON; and lets it stand still.

Standing still is SIGSTOP, so that it is at once, wherever the program is in its work.
"""

import json
import os
import signal
import subprocess
from collections.abc import Callable, Sequence
from select import select
from typing import Any, Final

from rig.transport.launcher import program_command, program_environment

#: Argument of a program that takes what processor time it gets.
AT_ONCE: Final = "at-once"
#: What a program says first: from now on the kernel kills it if we end, so it may be given its work, and be stopped.
READY: Final = {"ready": True}
#: So long a program may go on after a recording has begun: two pulses at 100 Hz.
_LOOK_S: Final = 0.02
_PIECE: Final = 1 << 16


def run_child(
    module: str,
    asked: dict[str, Any],
    *,
    busy: Callable[[], bool],
    wanted: Callable[[], bool],
    tell: Callable[[dict[str, Any]], None],
    hold: Callable[[bool], None],
    yielding: bool = True,
    inherited: Sequence[int] = (),
) -> dict[str, Any] | None:
    """Run a program to its end.

    Args:
        module: its main module; it calls `rig.background.program.serve`.
        asked: what it is to do.
        busy: whether it has to stand still at present; asked often, so it is to be quick.
        wanted: whether anybody still wants what it does.
        tell: takes what it says of how far it is.
        hold: called with True when it has to stand still from now on, with False when it goes on.
        yielding: whether it takes only the processor time that nobody else wants; False where nothing is recorded.
        inherited: descriptors that it has too, by the same numbers.

    Returns:
        What it said at its end; None if it was ended because nobody wants it any more.

    Raises:
        OSError: it cannot be started, or has ended by itself.
    """
    command, environment = [*program_command(module), *([] if yielding else [AT_ONCE])], program_environment()
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, pass_fds=inherited, env=environment
    ) as child:
        try:
            return _followed(child, asked, busy, wanted, tell, hold)
        finally:
            child.kill()


def _followed(
    child: "subprocess.Popen[bytes]",
    asked: dict[str, Any],
    busy: Callable[[], bool],
    wanted: Callable[[], bool],
    tell: Callable[[dict[str, Any]], None],
    hold: Callable[[bool], None],
) -> dict[str, Any] | None:
    held, ready, given, stopped, said = False, False, False, False, b""
    if child.stdin is None or child.stdout is None:
        raise TypeError("the program has no standard input and output")
    while wanted():
        if busy() != held:
            held = not held
            hold(held)
        if ready and not given and not held:
            given = True
            child.stdin.write(json.dumps(asked).encode() + b"\n")
            child.stdin.flush()
        if given and stopped != held:
            stopped = held
            child.send_signal(signal.SIGSTOP if stopped else signal.SIGCONT)
        readable, _, _ = select([child.stdout], [], [], _LOOK_S)
        if not readable:
            continue
        piece = os.read(child.stdout.fileno(), _PIECE)
        *lines, said = (said + piece).split(b"\n")
        for line in lines:
            news: dict[str, Any] = json.loads(line)
            if "end" in news:
                end: dict[str, Any] = news["end"]
                return end
            if news == READY:
                ready = True
            else:
                tell(news)
        if not piece:
            raise ChildProcessError(0, "the program has ended by itself")
    return None
