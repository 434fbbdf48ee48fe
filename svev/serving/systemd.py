"""Tells systemd, or the terminal, how the service is: log lines with priorities, readiness, status line, watchdog.

The supervisor's thread sends the notifications (sd_notify). It never waits for systemd: a message that the socket does
not take now is counted, and what still matters is sent again later. Linux queues ten datagrams unless told otherwise
(net.unix.max_dgram_qlen).
"""

import logging
import os
import socket
import sys
import time
from collections.abc import Mapping
from contextlib import suppress
from datetime import UTC, datetime
from typing import Final

from rig.clocks import NS_PER_S
from rig.events import Event, Level
from rig.phrase import plain
from svev.console import visible

#: Priorities of syslog, which the journal reads from the beginning of a line.
_PRIORITIES: Final = {Level.FATAL: 2, Level.ERROR: 3, Level.WARNING: 4, Level.INFO: 6, Level.DEBUG: 7}
_US_PER_S: Final = 1e6
#: The watchdog is fed so many times within its limit.
_FEEDS_PER_LIMIT: Final = 3


def log_line(event: Event, *, journal: bool) -> str:
    """An event as one line: for the journal with a priority, for a terminal with time (UTC) and level."""
    text = visible(f"{event.name}: {event.message}")
    if journal:
        return f"<{_PRIORITIES[event.level]}>{text}"
    time_ = datetime.fromtimestamp(event.time / NS_PER_S, UTC)
    return f"{time_:%H:%M:%S} {event.level.value:7} {text}"


def write_line(event: Event) -> None:
    """Write an event to standard error as one line. That nobody can read it ends nothing: the log has it too."""
    with suppress(OSError):
        sys.stderr.write(log_line(event, journal="JOURNAL_STREAM" in os.environ) + "\n")
        sys.stderr.flush()


class JournalHandler(logging.Handler):
    """Writes what libraries log in the same form, a traceback in one line."""

    def emit(self, record: logging.LogRecord) -> None:
        """Write one line."""
        levels = {logging.WARNING: Level.WARNING, logging.ERROR: Level.ERROR, logging.CRITICAL: Level.FATAL}
        write_line(Event.now(levels.get(record.levelno, Level.INFO), record.name, plain(self.format(record))))


class Notify:
    """Sends notifications to systemd; does nothing without `NOTIFY_SOCKET`.

    Args:
        environment: environment variables of the process.

    Attributes:
        unsent: number of messages that the socket did not take.
    """

    def __init__(self, environment: Mapping[str, str] = os.environ) -> None:
        self._socket = _connected(environment.get("NOTIFY_SOCKET", ""))
        ours = environment.get("WATCHDOG_PID", str(os.getpid())) == str(os.getpid())
        limit_s = float(environment.get("WATCHDOG_USEC", "0")) / _US_PER_S if ours else 0.0
        self._every_s = limit_s / _FEEDS_PER_LIMIT
        self._next_feed = 0.0
        self._status = ""
        self._due: dict[str, str] = {}
        self.unsent = 0

    def ready(self) -> None:
        """Say that the API answers."""
        self._tell("READY", "1")

    def status(self, text: str) -> None:
        """Set the line that `systemctl status` shows. Call it often: it also sends what is still due."""
        line = visible(text)
        if line != self._status:
            self._status = line
            self._due["STATUS"] = line
        self._send_due()

    def feed_watchdog(self) -> None:
        """Say that all is well; may be called at any rate."""
        if self._every_s and time.monotonic() >= self._next_feed and self._sent("WATCHDOG=1"):
            self._next_feed = time.monotonic() + self._every_s

    def stopping(self) -> None:
        """Say that the service has begun to end."""
        self._tell("STOPPING", "1")

    def close(self) -> None:
        """Close the socket."""
        if self._socket is not None:
            self._socket.close()

    def _tell(self, name: str, value: str) -> None:
        self._due[name] = value
        self._send_due()

    def _send_due(self) -> None:
        """Send what is due, oldest first, as far as the socket takes it."""
        for name, value in list(self._due.items()):
            if not self._sent(f"{name}={value}"):
                return
            self._due.pop(name, None)

    def _sent(self, state: str) -> bool:
        """Send one message without waiting.

        Returns:
            False if the socket did not take it: systemd does not read, or is gone.
        """
        if self._socket is None:
            return True
        try:
            self._socket.send(state.encode(errors="replace"))
        except OSError:
            self.unsent += 1
            return False
        return True


def _connected(address: str) -> socket.socket | None:
    """A socket that sends to systemd (sd_notify(3)); None without an address, or if nobody is there.

    Args:
        address: path of the socket; "@" begins a name that is in no file system.
    """
    if not address:
        return None
    channel = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    channel.setblocking(False)
    try:
        channel.connect(f"\0{address[1:]}" if address.startswith("@") else address)
    except OSError:
        channel.close()
        return None
    return channel
