"""The state of a run, in a file that is always whole: who looks at it sees every log, with its state and duration."""

import math
import time
from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

import msgspec

from rig.errors import StorageError
from rig.host.disk import replace_file
from season.running.logs import SeasonLog
from season.running.outcome import LogState, Outcome

FORMAT: Final = "svev-season-state/1"
NAME: Final = "state.json"
#: The file is written at most so often: with ten thousand logs it has some 3 MB.
_EVERY_S: Final = 5.0


class StateEntry(msgspec.Struct, kw_only=True):
    """A log in the file.

    Attributes:
        state: how far it is.
        since: when that began, UTC.
        duration_s: how long it took to be measured, or has been under way.
        problem: why it failed.
        key: of its result.
        jumps: measured jumps.
        host: name of the computer that measured it.
    """

    state: LogState
    since: str
    duration_s: float = 0.0
    problem: str | None = None
    key: str = ""
    jumps: int = 0
    host: str = ""


class _File(msgspec.Struct):
    format: str
    campaign: str
    counts: dict[str, int]
    logs: dict[str, StateEntry]


class SeasonState:
    """The state of all logs of a campaign.

    Args:
        path: of the file.
        campaign: its name.
        logs: of the campaign.
    """

    def __init__(self, path: Path, campaign: str, logs: Iterable[SeasonLog]) -> None:
        self._path, self._campaign = path, campaign
        self._started: dict[str, float] = {}
        self._written = -math.inf
        waiting = StateEntry(state=LogState.WAITING, since=_now())
        self.logs = {
            log.url: _settled(log.outcome) if log.is_settled and log.outcome is not None else waiting for log in logs
        }

    def run(self, url: str) -> None:
        """A log is being measured."""
        self.logs[url] = StateEntry(state=LogState.RUNNING, since=_now())
        self._started[url] = time.monotonic()
        self.write_sometimes()

    def wait(self, url: str) -> None:
        """A log is no longer being measured, and will be again."""
        self.logs[url] = StateEntry(state=LogState.WAITING, since=_now())
        self.write_sometimes()

    def settle(self, url: str, outcome: Outcome) -> None:
        """Something has come of a log."""
        self.logs[url] = _settled(outcome)
        self.write_sometimes()

    def fail(self, url: str, problem: str) -> None:
        """Nothing has come of a log this time; the next run tries it again."""
        self.logs[url] = StateEntry(
            state=LogState.FAILED, since=_now(), duration_s=self.running_s(url), problem=problem
        )
        self.write_sometimes()

    def running_s(self, url: str) -> float:
        """How long a log has been under way."""
        return round(time.monotonic() - self._started.get(url, time.monotonic()), 3)

    @property
    def counts(self) -> dict[str, int]:
        """Logs by state."""
        found = dict.fromkeys(map(str, LogState), 0)
        for entry in self.logs.values():
            found[entry.state] += 1
        return found

    def write_sometimes(self) -> None:
        """Write the file, unless that was done a moment ago."""
        if time.monotonic() - self._written >= _EVERY_S:
            self.write()

    def write(self) -> None:
        """Write the file.

        Raises:
            StorageError: the disk refuses.
        """
        for url, entry in self.logs.items():
            if entry.state is LogState.RUNNING:
                entry.duration_s = self.running_s(url)
        content = msgspec.json.encode(_File(FORMAT, self._campaign, self.counts, self.logs))
        try:
            replace_file(self._path, content + b"\n", links=False)
        except OSError as error:
            raise StorageError(
                f"{self._path}: cannot be written ({error.strerror}); make room, then run again"
            ) from error
        self._written = time.monotonic()


def _settled(outcome: Outcome) -> StateEntry:
    return StateEntry(
        state=outcome.state, since=outcome.started, duration_s=outcome.duration_s, problem=outcome.problem,
        key=outcome.key, jumps=outcome.jumps, host=outcome.host,
    )  # fmt: skip


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")
