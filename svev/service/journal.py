"""Log lines on standard error: one per event; in the systemd journal each with its priority."""

import logging
import os
import sys
from datetime import UTC, datetime
from typing import Final

from recorder.events import Event, Level
from rig.clocks import NS_PER_S

#: syslog priorities, as the journal reads them from the beginning of a line.
_PRIORITIES: Final = {Level.FATAL: 2, Level.ERROR: 3, Level.WARNING: 4, Level.INFO: 6, Level.DEBUG: 7}


def log_line(event: Event, *, journal: bool) -> str:
    """One line; the journal knows the time itself and gets the priority instead."""
    text = f"{event.name}: {event.message}".replace("\r", " ").replace("\n", " ")
    if journal:
        return f"<{_PRIORITIES[event.level]}>{text}"
    time = datetime.fromtimestamp(event.time / NS_PER_S, UTC)
    return f"{time:%H:%M:%S} {event.level.value:7} {text}"


def write_line(event: Event) -> None:
    """Write the line of an event."""
    sys.stderr.write(log_line(event, journal="JOURNAL_STREAM" in os.environ) + "\n")
    sys.stderr.flush()


class JournalHandler(logging.Handler):
    """What libraries log, in the same form; a traceback in one line."""

    def emit(self, record: logging.LogRecord) -> None:
        """Write one line."""
        levels = {logging.WARNING: Level.WARNING, logging.ERROR: Level.ERROR, logging.CRITICAL: Level.FATAL}
        write_line(Event.now(levels.get(record.levelno, Level.INFO), record.name, self.format(record)))
