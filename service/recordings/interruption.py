"""A recording whose recorder died: reads what its log holds, so that a new recorder goes on with the next number."""

import threading
import time
from concurrent.futures import Future
from pathlib import Path
from typing import Final

import msgspec

from recorder.reading.info import LogInfo, info
from rig.api.recordings import SessionFields
from rig.clocks import NS_PER_S, HostNs
from rig.errors import SvevError
from rig.transport.recorder_commands import GoesOn, StartRecording

#: A disk from which the log is not read within this time hangs.
_READ_S: Final = 10.0
#: A recorder that dies so often within so many seconds would die again.
DEATHS_MAX: Final = 3
DEATHS_WITHIN_S: Final = 60.0
#: With fewer pulses than this their rate is not measured well, and that of the rig file is used.
_RATE_PULSES: Final = 10


class Interruption:
    """The time from the death of a recorder until a new one goes on. The log is read in a thread of its own.

    Args:
        log: the last log of the dead recorder.
        error: how it died.

    Attributes:
        error: as given.
        resumed: whether a new recorder has been told to go on.
    """

    def __init__(self, log: Path, error: SvevError) -> None:
        self.error, self.resumed = error, False
        self._log, self._until = log, time.monotonic() + _READ_S
        self._found: Future[LogInfo] = Future()
        # Never keeps the process alive: the disk may hang for ever.
        threading.Thread(target=self._read, name="reads a log", daemon=True).start()

    @property
    def over(self) -> bool:
        """Whether the log is read, or cannot be."""
        return self._found.done() or time.monotonic() > self._until

    def found(self) -> LogInfo | None:
        """What the log holds; None if it cannot be read."""
        return self._found.result() if self._found.done() and self._found.exception() is None else None

    def _read(self) -> None:
        try:
            self._found.set_result(info(self._log, original=True))
        except Exception as error:  # noqa: BLE001 - whatever is odd about the log, the recording ends then
            self._found.set_exception(error)


def died_too_often(deaths: list[float]) -> bool:
    """Whether a recorder that died at these times, on the monotonic clock, s, is not to be trusted any more."""
    now = time.monotonic()
    return sum(now - death < DEATHS_WITHIN_S for death in deaths) >= DEATHS_MAX


def going_on(
    order: StartRecording, session: SessionFields, log: LogInfo, first_id: str, commanded: HostNs, period_ns: float
) -> StartRecording:
    """The order for a log that continues another one.

    Args:
        order: that for the other one.
        session: the session fields, as they are now.
        log: what the other log holds.
        first_id: id of the recording's first log, after which all others are named.
        commanded: when the recording was started.
        period_ns: nominal time between two pulses.
    """
    ledger = log.ledger
    measured = ledger.pulses >= _RATE_PULSES and ledger.rate_hz is not None
    before = GoesOn(
        recording=log.path.stem,
        commanded=commanded,
        pulse=ledger.last_pulse,
        time=ledger.last_time,
        period_ns=NS_PER_S / ledger.rate_hz if measured and ledger.rate_hz else period_ns,
    )
    others = {name: text for name, text in order.session.items() if name not in SessionFields.model_fields}
    fields = {name: text for name, text in session.model_dump().items() if text}
    return msgspec.structs.replace(
        order, path=_next_path(log.path.parent, first_id, log.path.suffix), session=others | fields, goes_on=before
    )


def _next_path(folder: Path, first_id: str, suffix: str) -> Path:
    part = 2
    while (path := folder / f"{first_id}-part{part}{suffix}").exists():
        part += 1
    return path
