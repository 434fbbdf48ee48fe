"""Runs tasks on a Dask cluster: of this computer's cores, or of a scheduler that somebody else has started.

Never more than two tasks per thread are under way, so that the scheduler's memory does not grow with the season, and
the number of workers never changes (decision 0077). A task whose worker dies is run again when all others are done,
alone: if a worker dies then, this task is the cause. A task counts as running when its worker has begun it.
"""

import logging
import os
import time
import uuid
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from queue import Empty, SimpleQueue
from typing import Any, Final, Protocol

import dask
from dask.utils import format_bytes
from distributed import CancelledError, Client, Future, KilledWorker, LocalCluster, get_worker, wait
from distributed.comm.core import CommClosedError

from rig.errors import BadInputError, ProcessDiedError
from season.campaign import Cluster

_PER_THREAD: Final = 2
_CONNECT_S: Final = 10.0
_LOOK_S: Final = 2.0
_PATIENCE: Final = 60
_LOCAL: Final = "127.0.0.1"
_SAFE_PATH: Final = "PYTHONSAFEPATH"
#: Results are on the disk: nothing is kept in a worker's memory that it could move there or wait for. Dask's
#: environment of workers has memory given back at each release (MALLOC_TRIM_THRESHOLD_); a quarter of a jump's time
#: would be page faults.
_CONFIGURED: Final = {
    "distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": None,
    "distributed.scheduler.allowed-failures": 0,
    "distributed.worker.memory.target": False,
    "distributed.worker.memory.spill": False,
    "distributed.worker.memory.pause": False,
    "distributed.worker.memory.terminate": 0.95,
    "distributed.worker.daemon": True,
}


class Hearer(Protocol):
    """Receives the progress of the tasks of a run."""

    def started(self, name: str) -> None:
        """A worker has begun a task, or begun it again."""

    def interrupted(self, name: str) -> None:
        """The worker of a task has died; it waits for another one."""

    def waiting(self) -> None:
        """Tasks are under way; called every two seconds or more often."""

    def done(self, name: str, result: Any) -> None:
        """A task has ended, with this result."""

    def failed(self, name: str, error: BaseException) -> None:
        """A task has ended by an error."""

    def killed(self, name: str, why: str) -> None:
        """A task has ended two workers and is not tried again."""


@dataclass(frozen=True, slots=True)
class Engine:
    """A cluster to run tasks on.

    Attributes:
        client: connected to its scheduler.
        dashboard: address of Dask's own page; None if there is none.
        restore: starts lost workers again; Dask itself gives up those that die while they start.
    """

    client: Client
    dashboard: str | None
    restore: Callable[[], None]

    @property
    def threads(self) -> int:
        """Threads of all workers, now."""
        return sum(self.client.nthreads().values())


@contextmanager
def engine(cluster: Cluster, dashboard: str) -> Iterator[Engine]:
    """Start workers on this computer, or connect to a scheduler.

    Args:
        cluster: which.
        dashboard: address of the dashboard of a cluster of this computer, host:port; port 0: any free one.

    Raises:
        BadInputError: the scheduler does not answer, or has no workers.
    """
    with dask.config.set(_CONFIGURED):
        if cluster.scheduler is None:
            count = cluster.workers or len(os.sched_getaffinity(0))
            with (
                _away_from_the_present_folder(),
                LocalCluster(
                    host=_LOCAL, n_workers=count, threads_per_worker=1, memory_limit=cluster.memory_bytes,
                    dashboard_address=dashboard, silence_logs=logging.CRITICAL,
                ) as local,
                Client(local) as client,
            ):  # fmt: skip
                yield Engine(client, local.dashboard_link, partial(local.scale, count))
            return
        try:
            client = Client(cluster.scheduler, timeout=_CONNECT_S)
        except (OSError, ValueError) as error:
            raise BadInputError(
                f"{cluster.scheduler}: no Dask scheduler answers there ({error}); start one by `dask scheduler`"
            ) from error
        with client:
            if not client.nthreads():
                raise BadInputError(
                    f"{cluster.scheduler}: has no workers; start some by `dask worker {cluster.scheduler}`"
                )
            yield Engine(client, client.dashboard_link, lambda: None)


@contextmanager
def _away_from_the_present_folder() -> Iterator[None]:
    """Python processes that begin meanwhile import nothing from the present folder, where users have files of any name.

    Those of `multiprocessing` begin by `python -c`, which looks there first.
    """
    before = os.environ.get(_SAFE_PATH)
    os.environ[_SAFE_PATH] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ[_SAFE_PATH]
        else:
            os.environ[_SAFE_PATH] = before


def run_tasks(on: Engine, function: Callable[[Any], Any], arguments: Iterable[tuple[str, Any]], hearer: Hearer) -> None:
    """Run a function once for each name, on any worker.

    Args:
        on: the cluster.
        function: to run.
        arguments: names, which differ, and the argument of each; they are asked for one by one, as there is room.
        hearer: is told what becomes of them.

    Raises:
        ProcessDiedError: the scheduler is gone, or no worker came back.
    """
    try:
        suspects = _Run(on, function, hearer, last=False).all_of(arguments)
        _Run(on, function, hearer, last=True).all_of(suspects)
    except (CommClosedError, OSError) as error:
        raise _gone(str(error)) from error


def mapped(on: Engine, function: Callable[[Any], Any], arguments: Iterable[Any]) -> list[Any]:
    """What `map` gives, computed on any worker.

    Raises:
        ProcessDiedError: the scheduler is gone, no worker came back, or two workers died of a task.
        Exception: what the function has raised.
    """
    hearer = _Results()
    run_tasks(on, function, ((str(place), argument) for place, argument in enumerate(arguments)), hearer)
    return [hearer.found[name] for name in sorted(hearer.found, key=int)]


class _Results:
    """Keeps what tasks return."""

    def __init__(self) -> None:
        self.found: dict[str, object] = {}

    def started(self, name: str) -> None:
        """Nothing is kept."""

    def interrupted(self, name: str) -> None:
        """Nothing is kept."""

    def waiting(self) -> None:
        """Nothing is to be done."""

    def done(self, name: str, result: Any) -> None:
        self.found[name] = result

    def failed(self, name: str, error: BaseException) -> None:  # noqa: ARG002 - as the protocol wants it
        raise error

    def killed(self, name: str, limit: str) -> None:  # noqa: ARG002 - as the protocol wants it
        raise ProcessDiedError(f"two workers died of a task: it needs more than {limit} of memory, or crashes svev")


def _told(function: Callable[[Any], Any], topic: str, name: str, argument: Any) -> Any:
    """Tell that a worker has begun a task, and do it."""
    get_worker().log_event(topic, name)
    return function(argument)


class _Run:
    """Tasks until the last of them has ended.

    Args:
        on, function, hearer: as `run_tasks`.
        last: these tasks have each seen a worker die; they run one at a time, and another death ends them.
    """

    def __init__(self, on: Engine, function: Callable[[Any], Any], hearer: Hearer, *, last: bool) -> None:
        self._on, self._function, self._hearer = on, function, hearer
        self._last = last
        self._topic = f"svev-{uuid.uuid4().hex}"
        self._begun: SimpleQueue[str] = SimpleQueue()
        self._names: dict[Future[Any], str] = {}
        self._arguments: dict[str, object] = {}
        self._suspects: list[tuple[str, Any]] = []
        self._threads, self._counted = 0, -_LOOK_S

    def all_of(self, arguments: Iterable[tuple[str, Any]]) -> list[tuple[str, Any]]:
        """Run these tasks.

        Returns:
            Those that saw a worker die.
        """
        left, more = iter(arguments), True
        self._on.client.subscribe_topic(self._topic, lambda event: self._begun.put(event[1]))
        try:
            while more or self._names:
                while more and len(self._names) < self._room():
                    name, argument = next(left, (None, None))
                    more = name is not None
                    if name is not None:
                        self._submit(name, argument)
                for future in self._ended() if self._names or more else ():
                    self._end(self._names.pop(future), future)
        finally:
            self._on.client.unsubscribe_topic(self._topic)
        return self._suspects

    def _room(self) -> int:
        """How many tasks may be under way; the scheduler is asked for its workers only now and then."""
        if self._last:
            return 1
        if (now := time.monotonic()) >= self._counted + _LOOK_S:
            self._threads, self._counted = self._on.threads, now
        return _PER_THREAD * self._threads

    def _submit(self, name: str, argument: Any) -> None:
        # pure=False: a name of its own, else Dask would take the result of an equal task for that of this one.
        future = self._on.client.submit(_told, self._function, self._topic, name, argument, pure=False)
        self._names[future], self._arguments[name] = name, argument

    def _hear(self) -> None:
        """Tell of the tasks that workers have begun."""
        with suppress(Empty):
            while True:
                name = self._begun.get_nowait()
                if name in self._arguments:
                    self._hearer.started(name)

    def _ended(self) -> set[Future[Any]]:
        """Wait for the first of the tasks to end.

        Returns:
            Those that have ended; perhaps none, when there may be room for more.

        Raises:
            ProcessDiedError: no worker came back.
        """
        for _ in range(_PATIENCE):
            self._hear()
            self._hearer.waiting()
            if self._names:
                with suppress(TimeoutError):
                    done, _ = wait(list(self._names), timeout=_LOOK_S, return_when="FIRST_COMPLETED")
                    return set(done)
            else:
                time.sleep(_LOOK_S)  # all workers are being started again
            if self._on.threads:
                return set()
            self._on.restore()
        raise _gone(f"no worker for {_PATIENCE * _LOOK_S:g} s")

    def _end(self, name: str, future: Future[Any]) -> None:
        if future.status == "finished":
            try:
                result = future.result(timeout=_CONNECT_S)
            except (TimeoutError, KilledWorker, CancelledError):
                self._names[future] = name  # its worker has died with the result: its state is looked at again
                return
            del self._arguments[name]
            self._hearer.done(name, result)
        elif future.status == "pending":
            self._names[future] = name  # its worker died with the result, and Dask runs it again
        elif future.status == "lost" and self._on.client.status == "running" and not self._last:
            self._suspect(name)  # its worker died with the result, and Dask does not run it again
        elif future.status != "error":
            raise _gone(f"a task is {future.status}")
        else:
            self._end_by(future.exception(timeout=_CONNECT_S), name)

    def _end_by(self, error: BaseException, name: str) -> None:
        if isinstance(error, KilledWorker) and not (self._last or error.allowed_failures):
            self._suspect(name)
            return
        del self._arguments[name]
        if not isinstance(error, KilledWorker):
            self._hearer.failed(name, error)
        else:  # also where a scheduler of somebody else has tried more often itself
            limit = format_bytes(error.last_worker.memory_limit) if error.last_worker.memory_limit else "its"
            self._hearer.killed(name, limit)

    def _suspect(self, name: str) -> None:
        self._suspects.append((name, self._arguments.pop(name)))
        self._hearer.interrupted(name)


def _gone(why: str) -> ProcessDiedError:
    return ProcessDiedError(
        f"the Dask scheduler or its workers are gone ({why}); run the command again: a season keeps what is measured"
    )
