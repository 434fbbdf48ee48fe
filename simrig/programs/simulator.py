"""The main loop of a process of simulated cameras: obeys the commands of its owner (`simrig.programs.messages`)."""

import os
import sys
import threading
import traceback
from collections.abc import Callable
from typing import Any, Final, Protocol, TypeVar

import msgspec

from rig.errors import BadInputError
from rig.transport.channel import ControlChannel
from rig.transport.child import begin
from rig.transport.message import Quit
from simrig.programs.messages import Answer, Done, Refused

Config = TypeVar("Config")

#: Short, so that a thread with a deadline waits only briefly for the rendering thread.
_SWITCH_INTERVAL_S: Final = 0.0005
_IDLE_S: Final = 60.0


class Program(Protocol):
    """What runs in the process."""

    def start(self) -> None:
        """Open sockets and start threads."""
        ...

    def obey(self, command: Any) -> Answer:
        """Carry out a command.

        Raises:
            BadInputError: it cannot be carried out.
        """
        ...

    def stop(self) -> None:
        """Stop threads and close sockets."""
        ...


def run(config: type[Config], commands: Any, make: Callable[[Config], Program]) -> int:
    """Run a program until its owner tells it to quit or is gone.

    Args:
        config: type of the configuration.
        commands: union of the types of the commands.
        make: makes the program from its configuration.

    Returns:
        Exit code: 0 told to quit, 2 the configuration cannot work.
    """
    child = begin(config, commands, grace_s=0.0, killed_with_parent=True)
    threading.excepthook = _die
    sys.setswitchinterval(_SWITCH_INTERVAL_S)
    try:
        program = make(child.config)
    except BadInputError as error:
        child.control.send(Refused(reason=str(error)))
        return error.exit_code
    program.start()
    try:
        child.control.send(Done())
        _serve(program, child.control)
    finally:
        program.stop()
    return 0


def _serve(program: Program, control: ControlChannel[Any]) -> None:
    """Obey commands until `Quit` or the end of the owner."""
    while not control.ended:
        try:
            command = control.next(_IDLE_S)
            if command is None:
                continue
            if isinstance(command, Quit):
                return
            answer = program.obey(command)
        except (BadInputError, msgspec.MsgspecError) as error:
            answer = Refused(reason=str(error))
        control.send(answer)


def _die(failure: threading.ExceptHookArgs) -> None:
    """End the process when one of its threads fails: it must not look alive."""
    traceback.print_exception(failure.exc_type, failure.exc_value, failure.exc_traceback)
    os._exit(1)
