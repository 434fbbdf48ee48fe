"""The first thing that every child process does: set up its control channel, its signals and its lifeline."""

import atexit
import os
import select
import socket
import sys
import threading
import time
from collections.abc import Callable
from typing import Any, Final, Generic, TypeVar

import msgspec

from rig.host.endings import be_killed_with_parent, leave_signals_to_parent
from rig.transport.channel import ControlChannel
from rig.transport.message import Quit

Config = TypeVar("Config")

_CONFIG_S: Final = 10.0
#: At the end of a process its last reports wait so long for a parent that does not read.
_LAST_REPORTS_S: Final = 5.0
_BAD_CONFIG: Final = 2
_THREAD_FAILED: Final = 70  # EX_SOFTWARE of <sysexits.h>


class ChildContext(Generic[Config]):
    """Set up by `begin`.

    Attributes:
        name: name of the process.
        control: channel to the parent.
        config: first message of the parent.
        on_command: called with each message but `Quit` by `stopping` and `stops_within`.
    """

    def __init__(self, name: str, control: ControlChannel[Any], config: Config, grace_s: float) -> None:
        self.name, self.control, self.config = name, control, config
        self._grace_s = grace_s
        self._stop = False
        self.on_command: Callable[[Any], None] = lambda _: None

    def stopping(self) -> bool:
        """Whether the parent asked to quit, or is gone.

        From then on the process has its grace to end by itself, since a camera's driver may block for long on a camera
        that is dead.
        """
        if not self._stop:
            for message in self.control.receive(0):
                if isinstance(message, Quit):
                    self._stop = True
                else:
                    self.on_command(message)
            self._stop = self._stop or self.control.ended
            if self._stop:
                end_in(self._grace_s)
        return self._stop

    def stops_within(self, seconds: float) -> bool:
        """Wait, but not beyond the moment from which the process is `stopping`; whether it is."""
        end = time.monotonic() + seconds
        while not self.stopping():
            left = end - time.monotonic()
            if left <= 0:
                return False
            select.select([self.control], [], [], left)
        return True


def begin(
    config: type[Config], commands: Any, grace_s: float, *, killed_with_parent: bool = False
) -> ChildContext[Config]:
    """Read the command line `NAME CONTROL_FD` and the configuration; ignore signals, install the lifeline.

    Ctrl-C and Ctrl-Z in a terminal go to every process of the group, and SIGTERM where a session ends. Children ignore
    them: the parent tells them what to do, and while it is stopped, they go on.

    Args:
        config: type of the configuration, which is the first message.
        commands: type of the commands that follow, or union of them.
        grace_s: time that the process has to finish its work after the parent is gone. 0: it has none to finish, so the
            end of the parent ends it at once.
        killed_with_parent: let the kernel kill the process, frozen (SIGSTOP) or not, as soon as the *thread* that
            started it ends. The lifeline does not reach a frozen process.

    Raises:
        SystemExit: no configuration came.
    """
    end_with_failed_thread()
    if killed_with_parent:
        be_killed_with_parent()
    name, fd = sys.argv[1], int(sys.argv[2])
    control: ControlChannel[Any] = ControlChannel(socket.socket(fileno=fd), config | commands)
    try:
        first = control.next(_CONFIG_S)
    except msgspec.MsgspecError as error:
        sys.stderr.write(f"{name}: the configuration is wrong ({error}); this program is started by svev\n")
        raise SystemExit(_BAD_CONFIG) from None
    if not isinstance(first, config):
        raise SystemExit(f"{name}: no configuration came; this program is started by svev")
    atexit.register(control.drain, _LAST_REPORTS_S)
    context = ChildContext(name, control, first, grace_s)
    leave_signals_to_parent()
    threading.Thread(target=_lifeline, args=(fd, grace_s), daemon=True, name="lifeline").start()
    return context


def end_with_failed_thread() -> None:
    """Let an unforeseen error in any thread end the process, so that its parent notices.

    A process that goes on without one of its threads looks healthy and does only part of its work.
    """

    def end(failed: threading.ExceptHookArgs) -> None:
        threading.__excepthook__(failed)
        sys.stderr.flush()
        os._exit(_THREAD_FAILED)

    threading.excepthook = end


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
