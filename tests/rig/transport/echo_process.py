"""A child process for tests: reports its configuration, then waits for the command to quit, or ignores it."""

import os
import select
import threading

from rig.transport.child import begin
from rig.transport.message import Message, Quit


class EchoConfig(Message):
    """Configuration of the child."""

    value: int = 0
    deaf: bool = False


def main() -> None:
    """Run as a child of a process table."""
    child = begin(EchoConfig, Quit, 5.0, killed_with_parent="ECHO_KILLED_WITH_PARENT" in os.environ)
    child.control.send(child.config)
    if child.config.deaf:
        threading.Event().wait(60)
    while not child.stopping():
        select.select([child.control], [], [], 0.1)


if __name__ == "__main__":
    main()
