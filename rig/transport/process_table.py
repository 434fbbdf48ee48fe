"""Starts child processes, speaks to them, ends them: single ones, or a table of them that are restarted by name.

A child is a plain program, started by the launcher. It inherits exactly the descriptors of its row, and a control
channel whose end tells it that the parent is gone. Nothing is named in the file system, so nothing is left behind.
"""

import select
import signal
import socket
import subprocess
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import IO, Any, Final

from rig.errors import ProcessDiedError
from rig.phrase import phrase
from rig.transport.channel import ControlChannel
from rig.transport.launcher import start_program
from rig.transport.message import Quit

_STOP_S: Final = 8.0
_KILLED_S: Final = 3.0  # after SIGKILL the kernel needs a moment
_FIRST_WAIT_S: Final = 1.0
_LONGEST_WAIT_S: Final = 30.0
_GOOD_S: Final = 60.0


@dataclass(frozen=True, slots=True)
class ProcessSpec:
    """One row: what to start.

    Attributes:
        name: unique, shown in messages and in `ps`.
        module: run as `python -m MODULE NAME CONTROL_FD`; its function `main` calls `rig.transport.child.begin` first.
        config: first message that the child receives.
        inherit: descriptors that the child inherits under the same numbers.
        environment: variables that the child has beside ours.
        reports: type of the messages that the child sends, or union of them; None: it sends none.
        own_group: put the child into a process group of its own, where signals of the terminal do not reach it.
        output: file for the child's standard output and error; None: they go where ours go.
    """

    name: str
    module: str
    config: object
    inherit: tuple[int, ...] = field(default=())
    environment: Mapping[str, str] = field(default_factory=dict)
    reports: Any = None
    own_group: bool = False
    output: IO[bytes] | None = None


class Child:
    """A started row.

    Attributes:
        spec: the row.
        started: when, on the host's monotonic clock, s.
        control: channel to it.
    """

    def __init__(self, spec: ProcessSpec) -> None:
        self.spec = spec
        self.started = time.monotonic()
        ours, theirs = socket.socketpair()
        with theirs:
            self._process = start_program(
                spec.module,
                (spec.name, str(theirs.fileno())),
                (*spec.inherit, theirs.fileno()),
                spec.environment,
                own_group=spec.own_group,
                output=None if spec.output is None else spec.output.fileno(),
            )
        self.control: ControlChannel[Any] = ControlChannel(ours, spec.reports)
        self.control.send(spec.config)

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    def ending(self) -> str | None:
        """How the process ended, in words; None while it runs."""
        code = self._process.poll()
        if code is None:
            return None
        return f"killed by {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"

    def answer(self, patience_s: float) -> Any:
        """The next message of the child, waiting for it at most `patience_s` seconds.

        Raises:
            ProcessDiedError: the child ended, or said nothing in time and so was killed.
        """
        message = self.control.next(patience_s)
        if message is not None:
            return message
        if self.control.ended:
            self.wait(_KILLED_S)
            text, how = "{process} ended by itself ({how}): see its messages above", self.ending() or ""
            raise ProcessDiedError(phrase("why_ended_by_itself", text, process=self.spec.name, how=how))
        self.kill()
        text = "{process} did not answer for {seconds:.0f} s, so it was ended: restart it"
        raise ProcessDiedError(phrase("why_no_answer", text, process=self.spec.name, seconds=patience_s))

    def send_signal(self, number: int) -> None:
        """Send a signal; does nothing if the process has ended."""
        self._process.send_signal(number)

    def wait(self, timeout_s: float) -> bool:
        """Wait for its end.

        Returns:
            False if it still runs after `timeout_s` seconds.
        """
        try:
            self._process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            return False
        return True

    def kill(self, patience_s: float = _KILLED_S) -> None:
        """End it now, wait at most `patience_s` seconds until it is gone, and close the channel."""
        self._process.kill()
        self.wait(patience_s)
        self.control.close()

    def stop(self, timeout_s: float) -> bool:
        """Wait for the end that a `Quit` asked for, kill the child if it does not come, and close the channel.

        Returns:
            Whether it had to be killed.
        """
        deadline = time.monotonic() + timeout_s
        self.control.drain(timeout_s)
        in_time = self.wait(max(0.0, deadline - time.monotonic()))
        self.kill()
        return not in_time


class ProcessTable:
    """All children, by name."""

    def __init__(self) -> None:
        self._children: dict[str, Child] = {}

    def __getitem__(self, name: str) -> Child:
        return self._children[name]

    def start(self, spec: ProcessSpec) -> Child:
        """Start a row, in place of a dead one of the same name."""
        if (old := self._children.pop(spec.name, None)) is not None:
            old.kill()
        child = self._children[spec.name] = Child(spec)
        return child

    def receive(self, timeout_s: float, wake: tuple[int, ...] = ()) -> list[tuple[str, Any]]:
        """Messages of all children, waiting at most `timeout_s` seconds for the first; sends what waits for them.

        Args:
            timeout_s: s.
            wake: descriptors that end the waiting too when they become readable; they are not read.
        """
        alive = [child for child in self._children.values() if not child.control.ended]
        poll = select.poll()
        for child in alive:
            poll.register(child.control, select.POLLIN | (select.POLLOUT if child.control.waiting else 0))
        for fd in wake:
            poll.register(fd, select.POLLIN)
        ready = {fd for fd, _ in poll.poll(timeout_s * 1000)}
        return [
            (child.spec.name, message)
            for child in alive
            if child.control.fileno() in ready
            for message in child.control.receive(0)
        ]

    def dead(self) -> list[Child]:
        """Children that ended."""
        return [child for child in self._children.values() if child.ending() is not None]

    def stop(self) -> list[str]:
        """Ask all to stop, wait together until the deadline, kill what is left.

        Returns:
            Names of those that had to be killed.
        """
        deadline = time.monotonic() + _STOP_S
        for child in self._children.values():
            child.control.send(Quit())
        left = [name for name, child in self._children.items() if child.stop(max(0.0, deadline - time.monotonic()))]
        self._children.clear()
        return left


@dataclass(frozen=True, slots=True)
class BackOff:
    """How long to wait before a dead child is started again.

    One second at first, twice as long after every further death, at most 30 s; one second again after a good minute.

    Attributes:
        deaths: number of deaths so far.
        wait_s: how long to wait after the last one, s.
    """

    deaths: int = 0
    wait_s: float = 0.0

    def died(self, lived_s: float) -> "BackOff":
        """After another death of a child that had run for so long, s."""
        fresh = lived_s >= _GOOD_S or not self.wait_s
        return BackOff(self.deaths + 1, _FIRST_WAIT_S if fresh else min(_LONGEST_WAIT_S, 2 * self.wait_s))

    def forgotten(self) -> "BackOff":
        """It begins with one second again, because a person has seen to the cause."""
        return BackOff(self.deaths)
