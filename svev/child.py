"""What every child process does first: its control channel, its signals, its lifeline."""

import os
import select
import signal
import socket
import sys
import threading
from typing import Final

from rig.control import ControlChannel, Message

#: After the parent is gone, a child has this long to bring its work to a clean end.
_GRACE_S: Final = 10.0
_CONFIG_S: Final = 10.0


class ChildContext:
    """Set up by `begin`.

    Attributes:
        name: row of the process table.
        control: channel to the parent.
        config: first message of the parent.
    """

    def __init__(self, name: str, control: ControlChannel, config: Message) -> None:
        self.name, self.control, self.config = name, control, config
        self._stop = False

    def stopping(self) -> bool:
        """Whether the parent asked to quit, is gone, or the process got SIGTERM."""
        if not self._stop:
            self._stop = any(m.get("command") == "quit" for m in self.control.receive(0)) or self.control.ended
        return self._stop

    def terminated(self) -> bool:
        """Whether the process got SIGTERM. For a main loop that reads the control channel itself."""
        return self._stop

    def ask_to_stop(self, *_: object) -> None:
        """Signal handler."""
        self._stop = True


def begin() -> ChildContext:
    """Read the command line `NAME CONTROL_FD` and the configuration; install signals and lifeline.

    Ctrl-C in a terminal goes to every process of the group; only the parent answers it, the children follow.
    """
    name, fd = sys.argv[1], int(sys.argv[2])
    control = ControlChannel(socket.socket(fileno=fd))
    messages = control.receive(_CONFIG_S)
    if not messages:
        raise SystemExit(f"{name}: no configuration came; this program is started by svev")
    context = ChildContext(name, control, messages[0])
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, context.ask_to_stop)
    threading.Thread(target=_lifeline, args=(fd,), daemon=True, name="lifeline").start()
    return context


def _lifeline(fd: int) -> None:
    """End the process for certain some time after the parent is gone, even if a camera's driver blocks."""
    poll = select.poll()
    poll.register(fd, 0)  # only hang-up and error: the main loop reads the data
    poll.poll()
    threading.Event().wait(_GRACE_S)
    os._exit(70)
