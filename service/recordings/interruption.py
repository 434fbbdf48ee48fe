"""A recording whose recorder died: reads what its log holds, so that a new recorder goes on with the next number."""

import threading
from collections.abc import Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import msgspec

from recorder.reading.info import LogInfo, info
from rig.api.recordings import SessionFields
from rig.clocks import NS_PER_S, HostNs
from rig.errors import SvevError
from rig.transport.recorder_commands import GoesOn, StartRecording

#: A disk from which the log is not read within this time hangs.
LOG_READ_S: Final = 10.0
#: A recorder that dies so often within so many seconds would die again.
DEATHS_MAX: Final = 3
DEATHS_WITHIN_S: Final = 60.0
#: With fewer pulses than this their rate is not measured well, and that of the rig file is used.
_RATE_PULSES: Final = 10


@dataclass(frozen=True, slots=True)
class FoundLog:
    """The log of a dead recorder.

    Attributes:
        log: what it holds.
        next: path of the log in which the recording goes on.
    """

    log: LogInfo
    next: Path


@dataclass(frozen=True, slots=True)
class Interruption:
    """The time from the death of a recorder until a new one goes on.

    Attributes:
        error: how it died.
        until: a log that is not read until then is on a disk that hangs; on the monotonic clock, s.
        read: whether the log is read, or cannot be.
        found: what it holds; None: it is not read, or cannot be.
        resumed: whether a new recorder has been told to go on.
    """

    error: SvevError
    until: float
    read: bool = False
    found: FoundLog | None = None
    resumed: bool = False

    def over(self, now: float) -> bool:
        """Whether it is known at a moment, on the monotonic clock, s, with which pulse the recording goes on."""
        return self.read or now > self.until


def begin_to_read(log: Path, first_id: str) -> "Future[FoundLog]":
    """Read a log in a thread of its own, which never keeps the process alive: the disk may hang for ever.

    Args:
        log: the last log of a dead recorder.
        first_id: id of the recording's first log, after which all others are named.
    """
    found: Future[FoundLog] = Future()

    def read() -> None:
        try:
            held = info(log, original=True)
            found.set_result(FoundLog(held, _next_path(log.parent, first_id, log.suffix)))
        except Exception as error:  # noqa: BLE001 - whatever is odd about the log, the recording ends then
            found.set_exception(error)

    threading.Thread(target=read, name="reads a log", daemon=True).start()
    return found


def died_too_often(deaths: Sequence[float], now: float) -> bool:
    """Whether a recorder that died at these times, on the monotonic clock, s, is not to be trusted any more."""
    return sum(now - death < DEATHS_WITHIN_S for death in deaths) >= DEATHS_MAX


def going_on(
    order: StartRecording, session: SessionFields, found: FoundLog, commanded: HostNs, period_ns: float
) -> StartRecording:
    """The order for a log that continues another one.

    Args:
        order: that for the other one.
        session: the session fields, as they are now.
        found: the other log.
        commanded: when the recording was started.
        period_ns: nominal time between two pulses.
    """
    ledger = found.log.ledger
    measured = ledger.pulses >= _RATE_PULSES and ledger.rate_hz is not None
    before = GoesOn(
        recording=found.log.path.stem,
        commanded=commanded,
        pulse=ledger.last_pulse,
        time=ledger.last_time,
        period_ns=NS_PER_S / ledger.rate_hz if measured and ledger.rate_hz else period_ns,
    )
    others = {name: text for name, text in order.session.items() if name not in SessionFields.model_fields}
    fields = {name: text for name, text in session.model_dump().items() if text}
    return msgspec.structs.replace(order, path=found.next, session=others | fields, goes_on=before)


def _next_path(folder: Path, first_id: str, suffix: str) -> Path:
    part = 2
    while (path := folder / f"{first_id}-part{part}{suffix}").exists():
        part += 1
    return path
