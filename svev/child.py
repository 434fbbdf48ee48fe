"""What every child process does first: its control channel, its signals, its lifeline."""

import os
import select
import signal
import socket
import sys
import threading
from typing import Final

from rig.control import ControlChannel, Message

_CONFIG_S: Final = 10.0


class ChildContext:
    """Set up by `begin`.

    Attributes:
        name: row of the process table.
        control: channel to the parent.
        config: first message of the parent.
    """

    def __init__(self, name: str, control: ControlChannel, config: Message, grace_s: float) -> None:
        self.name, self.control, self.config = name, control, config
        self._grace_s = grace_s
        self._stop = False

    def stopping(self) -> bool:
        """Whether the parent asked to quit, is gone, or the process got SIGTERM.

        From then on the process has its grace to come to an end by itself: a camera's driver may block for long on a
        camera that is dead.
        """
        if not self._stop:
            self._stop = any(m.get("command") == "quit" for m in self.control.receive(0)) or self.control.ended
            if self._stop:
                end_in(self._grace_s)
        return self._stop

    def terminated(self) -> bool:
        """Whether the process got SIGTERM. For a main loop that reads the control channel itself."""
        return self._stop

    def ask_to_stop(self, *_: object) -> None:
        """Signal handler."""
        self._stop = True


def begin(grace_s: float) -> ChildContext:
    """Read the command line `NAME CONTROL_FD` and the configuration; install signals and lifeline.

    Ctrl-C in a terminal goes to every process of the group; only the parent answers it, the children follow.

    Args:
        grace_s: after the parent is gone, the process has so long to bring its work to a clean end.
    """
    name, fd = sys.argv[1], int(sys.argv[2])
    control = ControlChannel(socket.socket(fileno=fd))
    messages = control.receive(_CONFIG_S)
    if not messages:
        raise SystemExit(f"{name}: no configuration came; this program is started by svev")
    context = ChildContext(name, control, messages[0], grace_s)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, context.ask_to_stop)
    threading.Thread(target=_lifeline, args=(fd, grace_s), daemon=True, name="lifeline").start()
    return context


def end_in(seconds: float) -> None:
    """End the process for certain after `seconds`, whatever it is doing then."""
    timer = threading.Timer(seconds, os._exit, (0,))
    timer.daemon = True
    timer.start()


def _lifeline(fd: int, grace_s: float) -> None:
    """Wait for the end of the parent, even while the main thread is blocked."""
    poll = select.poll()
    poll.register(fd, 0)  # only hang-up and error: the main loop reads the data
    poll.poll()
    end_in(grace_s)
