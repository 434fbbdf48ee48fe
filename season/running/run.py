"""Measures what is not measured yet of a campaign."""

import fcntl
import os
import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Any, Final

from rig.errors import BadInputError, StorageError, SvevError
from rig.host.object_store import Options, StoreSilentError
from season.campaign import Campaign
from season.running.logs import SeasonLog, find_logs, with_outcomes
from season.running.outcome import LogState, Outcome, decoded
from season.running.state import NAME, SeasonState
from season.running.stores import left_behind, read_outcomes
from season.running.task import give_up, measure

_LOCK: Final = ".lock"
#: After so many logs in a row whose store did not answer, each for a minute, the run ends.
_SILENCES: Final = 5
_LOCK_FLAGS: Final = os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK


@contextmanager
def alone(campaign: Campaign) -> Iterator[None]:
    """Make the folder of a campaign, and keep other runs out of it.

    Raises:
        BadInputError: one runs.
        StorageError: the folder cannot be made.
    """
    try:
        campaign.out.mkdir(parents=True, exist_ok=True)
        lock = os.fdopen(os.open(campaign.out / _LOCK, _LOCK_FLAGS, 0o644), "w")
    except OSError as error:
        raise StorageError(f"{campaign.out}: cannot be written ({error.strerror}); choose another folder") from error
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            text = f"{campaign.out}: another run of this campaign is at work; wait for its end"
            raise BadInputError(text) from None
        yield


def measure_logs(
    campaign: Campaign,
    *,
    again: bool,
    dashboard: str,
    started: Callable[[int, int, str | None], None],
    progress: Callable[[int], None],
) -> tuple[list[SeasonLog], SeasonState]:
    """Measure the logs of a campaign that have no result yet.

    Args:
        campaign: it.
        again: measure those that failed again.
        dashboard: address of the dashboard of a cluster of this computer.
        started: called when workers are there, with the number of logs to measure, of threads, and the dashboard's
            address; not called if there is nothing to do.
        progress: called with the number of logs that this run is done with.

    Returns:
        The logs with what came of them, and the state.

    Raises:
        BadInputError: campaign, survey, store or scheduler are wrong.
        ProcessDiedError: the scheduler is gone.
        StorageError: the store has ceased to answer.
    """
    logs = find_logs(campaign)
    state = SeasonState(campaign.out / NAME, campaign.name, logs)
    todo = [log for log in logs if not log.is_settled or (again and _failed(log))]
    state.write()
    if todo:
        left = left_behind(log.url for log in logs)
        try:
            logs = with_outcomes(logs, _measure(todo, campaign, state, dashboard, started, progress))
        finally:
            state.write()
        for path in left:
            shutil.rmtree(path, ignore_errors=True)
    return logs, state


def _measure(
    todo: Sequence[SeasonLog],
    campaign: Campaign,
    state: SeasonState,
    dashboard: str,
    started: Callable[[int, int, str | None], None],
    progress: Callable[[int], None],
) -> dict[str, Outcome]:
    from season.running.engine import engine, run_tasks  # noqa: PLC0415 - a finished season needs no workers

    with engine(campaign.cluster, dashboard) as on:
        started(len(todo), on.threads, on.dashboard)
        hearer = _Hearer({log.url: log for log in todo}, campaign.store, state, progress)
        run_tasks(on, partial(measure, options=campaign.store), hearer.logs.items(), hearer)
    return hearer.outcomes


class _Hearer:
    """Enters what becomes of logs into the state."""

    def __init__(
        self, logs: dict[str, SeasonLog], options: Options, state: SeasonState, progress: Callable[[int], None]
    ) -> None:
        self.logs, self._options, self._state, self._progress = logs, options, state, progress
        self.outcomes: dict[str, Outcome] = {}
        self._ended = self._silences = 0

    def started(self, name: str) -> None:
        self._state.run(name)

    def interrupted(self, name: str) -> None:
        self._state.wait(name)

    def waiting(self) -> None:
        self._state.write_sometimes()

    def done(self, name: str, result: Any) -> None:  # noqa: ARG002 - the key, which stands beside the log too
        try:
            found = decoded(read_outcomes([name], self._options)[0])
        except BadInputError as error:  # the store does not answer now
            self._fail(name, str(error))
            return
        if found is None:  # somebody has removed it, or this computer does not see the worker's disk
            self._fail(name, f"its result is not beside it: is {name} the same log here and where the workers are?")
        else:
            self._settle(name, found)

    def failed(self, name: str, error: BaseException) -> None:
        if isinstance(error, SvevError | OSError):  # perhaps another time
            self._fail(name, str(error))
            self._refuse_silence(error)
        else:
            why = f"svev failed in it ({type(error).__name__}: {error}): send it to those who make svev"
            self._give_up(name, why)

    def killed(self, name: str, limit: str) -> None:
        why = (
            f"two workers died of it: it needs more than {limit} of memory, or crashes svev; measure it by svev analyze"
        )
        self._give_up(name, why)

    def _give_up(self, name: str, why: str) -> None:
        try:
            found = give_up(self.logs[name], self._options, why, self._state.running_s(name))
        except OSError as error:
            self._fail(name, f"{why} (and that cannot be written beside it: {error})")
        else:
            self._settle(name, found)

    def _refuse_silence(self, error: BaseException) -> None:
        """End the run when the store does not answer for any log.

        Raises:
            StorageError: it did not for so many, one after the other.
        """
        self._silences = self._silences + 1 if isinstance(error, StoreSilentError) else 0
        if self._silences >= _SILENCES:
            text = f"{error}; what is measured stays: run the season again when it does"
            raise StorageError(text) from error

    def _settle(self, name: str, outcome: Outcome) -> None:
        self._silences = 0
        self.outcomes[name] = outcome
        self._state.settle(name, outcome)
        self._tick()

    def _fail(self, name: str, why: str) -> None:
        self._state.fail(name, why)
        self._tick()

    def _tick(self) -> None:
        self._ended += 1
        self._progress(self._ended)


def _failed(log: SeasonLog) -> bool:
    return log.outcome is not None and log.outcome.state is LogState.FAILED
