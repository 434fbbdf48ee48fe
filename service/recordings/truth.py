"""Writes truth and survey beside the logs of a simulated rig, after they are closed, while the rig goes on."""

import contextlib
import os
import threading
import time
from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from recorder.log.beside import survey_path, truth_path
from recorder.reading.triplets import tags
from rig.clocks import HostNs, UtcAnchor
from rig.errors import ProcessDiedError, SvevError
from rig.events import Event, Level
from rig.phrase import phrase
from rig.pulse import PulseNumber

#: Writes truth and survey of a recording; called with a path for each, and number and host time of each pulse.
WriteTruth = Callable[[Path, Path, Iterable[tuple[PulseNumber, HostNs]]], None]
#: Cameras, recorder and panel take precedence.
_NICENESS: Final = 15
#: A disk that has taken nothing for so long hangs, s.
_HANGS_S: Final = 5.0
_LOOK_S: Final = 0.2


@dataclass(frozen=True, slots=True)
class _Log:
    """A log whose truth is known.

    Attributes:
        path: the log.
        write: writes its truth and its survey.
        anchor: the relation of its UTC times to host time. The recorder took its own when it made the log, some
            milliseconds before: both are the same unless the UTC clock was set in between.
    """

    path: Path
    write: WriteTruth
    anchor: UtcAnchor


class TruthWriter:
    """Writes in a thread of its own, which never keeps the process alive: the disk of a log may hang.

    One thread calls `opened` and `closed`; any thread may call `wait`.

    Args:
        tell: takes an event for each truth that could not be written; any thread may call it.
    """

    def __init__(self, tell: Callable[[Event], None]) -> None:
        self._tell = tell
        self._open: list[_Log] = []
        self._changed = threading.Condition()
        self._waiting: list[_Log] = []
        self._busy = self._over = False
        self._moved = 0.0  # when something was last written or read, on the monotonic clock, s

    def opened(self, log: Path, write: WriteTruth | None) -> None:
        """Note that the recorder has just made a log; `write` is None if nobody knows its truth."""
        if write is not None:
            self._open.append(_Log(log, write, UtcAnchor.take()))

    def closed(self, failed: Collection[Path] = ()) -> None:
        """Begin to write the truth of all logs that were opened: their recording is over.

        Args:
            failed: logs whose end the disk did not take; it would not take their truth either.
        """
        # The last one first: the others ended because of their disks.
        logs, self._open = self._open[::-1], []
        for log in logs:
            if log.path in failed:
                self._lament(log, "the disk did not take the end of the log")
        with self._changed:
            self._waiting += [log for log in logs if log.path not in failed]
            if self._waiting and not self._busy:
                self._busy, self._moved = True, time.monotonic()
                threading.Thread(target=self._run, name="truth writer", daemon=True).start()

    @property
    def busy(self) -> bool:
        """Whether something is being written, on a disk that does not hang; any thread may ask."""
        return self._busy and time.monotonic() < self._moved + _HANGS_S

    def wait(self, timeout_s: float) -> bool:
        """Wait until everything is written; False if it is not after `timeout_s`, or if the disk hangs."""
        until = time.monotonic() + timeout_s
        with self._changed:
            while self.busy and (left := until - time.monotonic()) > 0:
                self._changed.wait(min(left, _LOOK_S))
            return not self._busy

    def end(self, timeout_s: float) -> None:
        """Wait likewise, then give up what is not written; nothing is left half written, unless the disk hangs."""
        if not self.wait(timeout_s):
            self._over = True
            self.wait(timeout_s)

    def _run(self) -> None:
        with contextlib.suppress(PermissionError):  # a sandbox may forbid it
            os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), _NICENESS)
        while True:
            with self._changed:
                if not self._waiting:
                    self._busy = False
                    self._changed.notify_all()
                    return
                log = self._waiting.pop(0)
            self._write(log)

    def _write(self, log: _Log) -> None:
        truth, survey = truth_path(log.path), survey_path(log.path)
        try:
            log.write(truth, survey, self._pulses(log))
            if not log.path.exists():  # deleted meanwhile
                truth.unlink(missing_ok=True)
                survey.unlink(missing_ok=True)
        except (OSError, ValueError, SvevError) as error:
            self._lament(log, str(error))

    def _lament(self, log: _Log, why: str) -> None:
        if log.path.exists():
            text = "what the simulated cameras saw is not written beside {log}: {why}"
            self._tell(Event.now(Level.ERROR, "truth", phrase("event_no_truth", text, log=log.path.name, why=why)))

    def _pulses(self, log: _Log) -> Iterator[tuple[PulseNumber, HostNs]]:
        for tag in tags(log.path):
            if self._over:
                raise ProcessDiedError("the service ends")
            self._moved = time.monotonic()
            yield tag.pulse, log.anchor.host(tag.time)
