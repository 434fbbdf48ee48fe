"""Sets up and takes down what being armed needs, in the background: the simulated hill if any, and the processes.

The supervisor's loop must turn while simulated cameras draw their first image or a dead camera holds up its grabber.
"""

from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import ExitStack, suppress
from typing import Any

from recorder.events import Event
from rig.clocks import HostNs, host_now
from rig.errors import SvevError
from rig.settings import RigSettings
from svev.rig_processes import RigProcesses
from svev.simulation import environment, simulated_hill


class RigSession:
    """Used by one thread, the supervisor's.

    Args:
        rig: the rig.
        on_event: is told of cameras and processes, from the thread that turns the processes, and of what `tell` tells.
        on_done: called from the background when something is done, to wake the supervisor.
        recorder: more configuration for the recorder.
        inherit: descriptors that the recorder inherits for it.

    Attributes:
        processes: the running processes, None while there are none or they are not complete.
    """

    def __init__(
        self,
        rig: RigSettings,
        on_event: Callable[[Event], None],
        on_done: Callable[[], None],
        *,
        recorder: Mapping[str, Any],
        inherit: tuple[int, ...],
    ) -> None:
        self._rig, self._on_event, self._on_done = rig, on_event, on_done
        self._recorder, self._inherit = recorder, inherit
        self._hill: ExitStack | None = None
        self._epoch: HostNs | None = None
        self._environment: Mapping[str, str] = {}
        self._job: Future[RigProcesses | None] | None = None
        self._worker = ThreadPoolExecutor(max_workers=1, thread_name_prefix="rig session")
        self.processes: RigProcesses | None = None

    @property
    def busy(self) -> bool:
        """Something is being set up or taken down, or its result has not been collected."""
        return self._job is not None

    @property
    def empty(self) -> bool:
        """Nothing runs, nothing is being done, and no simulated hill is held."""
        return not self.busy and self.processes is None and self._hill is None

    def tell(self, event: Event) -> None:
        """Tell of an event, also the recorder, if there is one: it publishes it and writes it into its log."""
        self._on_event(event)
        if self.processes is not None:
            self.processes.tell({"command": "event", **event.to_json()}, or_drop=True)

    def begin_set_up(self) -> None:
        """Start everything."""
        self._begin(self._set_up)

    def begin_take_down(self, *, keep_hill: bool) -> None:
        """Stop the processes and, unless it is kept for another try, the simulated hill."""
        processes, self.processes = self.processes, None
        self._begin(lambda: self._take_down(processes, keep_hill=keep_hill))

    def collect(self) -> None:
        """Take note of a job that is done.

        Raises:
            SvevError: it failed.
        """
        if self._job is not None and self._job.done():
            job, self._job = self._job, None
            self.processes = job.result()

    def close(self) -> None:
        """Stop whatever is left, and wait for it."""
        if self._job is not None:
            wait((self._job,))
            with suppress(SvevError):  # what could not be set up needs not be taken down
                self.collect()
        self.begin_take_down(keep_hill=False)
        self._worker.shutdown(wait=True)
        self.collect()

    def _begin(self, job: Callable[[], RigProcesses | None]) -> None:
        if self._job is not None:
            raise RuntimeError("one thing at a time: collect the last job first")
        self._job = self._worker.submit(job)
        self._job.add_done_callback(lambda _: self._on_done())

    def _set_up(self) -> RigProcesses:
        with ExitStack() as stack:
            if self._hill is None:
                epoch = host_now()
                self._environment = environment(stack.enter_context(simulated_hill(self._rig, epoch)))
                self._epoch = epoch
            processes = RigProcesses(
                self._rig, self._on_event, epoch=self._epoch, recorder=self._recorder, inherit=self._inherit,
                environment=self._environment,
            )  # fmt: skip
            processes.__enter__()
            self._hill = self._hill or stack.pop_all()
            return processes

    def _take_down(self, processes: RigProcesses | None, *, keep_hill: bool) -> None:
        if processes is not None:
            processes.__exit__(None, None, None)
        if not keep_hill and self._hill is not None:
            hill, self._hill = self._hill, None
            hill.close()
