"""The table of our child processes: started as plain programs, stopped with a deadline, then killed.

A child inherits exactly the descriptors that its row names, and a control channel whose end tells it that the
parent is gone. Nothing is forked, nothing is named in the file system, so nothing is left behind.
"""

import os
import select
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from rig.control import ControlChannel, Message

_STOP_S: Final = 8.0


@dataclass(frozen=True, slots=True)
class ProcessSpec:
    """One row: what to start.

    Attributes:
        name: unique, shown in messages and in `ps`.
        module: run as `python -m MODULE NAME CONTROL_FD`.
        config: first message that the child receives.
        inherit: descriptors that the child inherits under the same numbers.
        environment: variables that the child has beside ours.
    """

    name: str
    module: str
    config: Message
    inherit: tuple[int, ...] = field(default=())
    environment: Mapping[str, str] = field(default_factory=dict)


class Child:
    """A started row.

    Attributes:
        started: when, on the host's monotonic clock, s.
    """

    def __init__(self, spec: ProcessSpec) -> None:
        self.spec = spec
        self.started = time.monotonic()
        ours, theirs = socket.socketpair()
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", spec.module, spec.name, str(theirs.fileno())],
                stdin=subprocess.DEVNULL,
                pass_fds=(*spec.inherit, theirs.fileno()),
                env={**os.environ, **spec.environment},
            )
        self.control = ControlChannel(ours)
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

    def kill(self) -> None:
        """End it now and collect it."""
        self._process.kill()
        self._process.wait()


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
            old.control.close()
        child = self._children[spec.name] = Child(spec)
        return child

    def receive(self, timeout_s: float, wake: tuple[int, ...] = ()) -> list[tuple[str, Message]]:
        """Messages of all children, waiting at most `timeout_s` seconds for the first.

        Args:
            timeout_s: s.
            wake: descriptors that end the waiting too when they become readable; they are not read.
        """
        alive = [child for child in self._children.values() if not child.control.ended]
        watched: list[ControlChannel | int] = [*(child.control for child in alive), *wake]
        ready = select.select(watched, [], [], timeout_s)[0]
        return [
            (child.spec.name, message)
            for child in alive
            if child.control in ready
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
            child.control.send({"command": "quit"})
        killed = []
        for name, child in self._children.items():
            if not child.wait(max(0.0, deadline - time.monotonic())):
                child.kill()
                killed.append(name)
            child.control.close()
        self._children.clear()
        return killed
