"""Tells systemd how the service is, if systemd asked for it (sd_notify)."""

import os
import time
from collections.abc import Mapping
from typing import Final

from sdnotify import SystemdNotifier  # type: ignore[import-untyped]

_US_PER_S: Final = 1e6
#: The watchdog is fed so many times as often as it must be.
_EAGER: Final = 3


class Notify:
    """Silent without `NOTIFY_SOCKET`.

    Args:
        environment: of the process.
    """

    def __init__(self, environment: Mapping[str, str] = os.environ) -> None:
        self._notifier = SystemdNotifier() if "NOTIFY_SOCKET" in environment else None
        ours = environment.get("WATCHDOG_PID", str(os.getpid())) == str(os.getpid())
        limit_s = float(environment.get("WATCHDOG_USEC", "0")) / _US_PER_S if ours else 0.0
        self._every_s = limit_s / _EAGER
        self._next_feed = 0.0
        self._status = ""

    def ready(self) -> None:
        """The API listens."""
        self._send("READY=1")

    def status(self, text: str) -> None:
        """One line for `systemctl status`; sent when it changes."""
        line = text.replace("\n", " ")
        if line != self._status:
            self._status = line
            self._send(f"STATUS={line}")

    def feed_watchdog(self) -> None:
        """All is well; as often as you like."""
        if self._every_s and time.monotonic() >= self._next_feed:
            self._next_feed = time.monotonic() + self._every_s
            self._send("WATCHDOG=1")

    def stopping(self) -> None:
        """The service has begun to end."""
        self._send("STOPPING=1")

    def close(self) -> None:
        """Let go of the socket."""
        if self._notifier is not None and self._notifier.socket is not None:
            self._notifier.socket.close()

    def _send(self, state: str) -> None:
        if self._notifier is not None:
            # The library encodes in Latin-1; systemd reads UTF-8.
            self._notifier.notify(state.encode("ascii", "replace").decode("ascii"))
