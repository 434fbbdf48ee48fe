"""What a process of simulated cameras does first, and how it is spoken to.

The first line on standard input is its configuration, every further one a command, each a JSON object; every line is
answered by one JSON object on standard output, with `error` where it failed. The command "stop" ends the process. When
standard input ends, or the thread that started the process is gone, it ends too.
"""

import ctypes
import json
import os
import signal
import sys
import threading
import traceback
from collections.abc import Callable
from typing import Any, Protocol

from rig.errors import BadInputError
from simrig import freeze

#: so that a thread that has to be in time need not wait long for the one that renders
_SWITCH_INTERVAL_S = 0.0005
_PR_SET_PDEATHSIG = 1  # <linux/prctl.h>

Message = dict[str, Any]


class Program(Protocol):
    """What runs in the process."""

    def start(self) -> None:
        """Be there."""
        ...

    def obey(self, command: Message) -> Message:
        """Carry out a command.

        Returns:
            The answer.

        Raises:
            BadInputError: it cannot be carried out.
        """
        ...

    def stop(self) -> None:
        """Be gone."""
        ...


def run(make: Callable[[Message], Program]) -> int:
    """Run a program until it is told to stop.

    Args:
        make: makes the program from its configuration.

    Returns:
        Exit code: 0 stopped, 2 bad configuration.
    """
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)  # the end of input alone does not end a frozen process
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for whoever started us
    threading.excepthook = _die
    freeze.watch()
    sys.setswitchinterval(_SWITCH_INTERVAL_S)
    line = sys.stdin.readline()
    if not line:
        return 0
    try:
        program = make(_object(line))
    except BadInputError as error:
        _answer({"error": str(error)})
        return error.exit_code
    program.start()
    try:
        _answer({"pid": os.getpid()})
        _serve(program)
    finally:
        program.stop()
    return 0


def _serve(program: Program) -> None:
    """Obey commands until the stop command or the end of standard input."""
    for line in sys.stdin:
        try:
            command = _object(line)
            stopping = command.get("command") == "stop"
            answer = {} if stopping else program.obey(command)
        except BadInputError as error:
            answer, stopping = {"error": str(error)}, False
        _answer(answer)
        if stopping:
            return


def _object(line: str) -> Message:
    try:
        data = json.loads(line)
    except json.JSONDecodeError as error:
        raise BadInputError(f"a line on standard input is no JSON ({error}); send one object per line") from None
    if not isinstance(data, dict):
        raise BadInputError("a line on standard input is no JSON object; send one object per line")
    return data


def _answer(data: Message) -> None:
    sys.stdout.write(json.dumps(data) + "\n")
    sys.stdout.flush()


def _die(failure: threading.ExceptHookArgs) -> None:
    """A program that lost a thread must not look alive."""
    traceback.print_exception(failure.exc_type, failure.exc_value, failure.exc_traceback)
    os._exit(1)
