"""Starts and stops the processes of a rig, and its simulated hill if it has one, in a background thread.

The supervisor's loop has to go on while simulated cameras draw their first images or a grabber waits for a dead camera.
"""

from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import AbstractContextManager, ExitStack, suppress
from functools import partial

from rig.clocks import HostNs, host_now
from rig.errors import ProcessDiedError, SvevError
from rig.events import Event
from rig.phrase import phrase
from rig.settings.model import RigSettings
from rig.transport.recorder_commands import RecorderOptions, TellEvent
from service.processes.backends import prepare_programs
from service.processes.rig_processes import RigProcesses
from service.processes.seen import Seen
from service.processes.simulation import hill_environment, simulated_truth
from service.recordings.truth import WriteTruth

#: Starts simulated cameras with pulse 0 at a host time; yields the environment variables that grabbers need for them.
StartHill = Callable[[HostNs], AbstractContextManager[Mapping[str, str]]]


class RigSession:
    """The processes from arming to disarming. Only the supervisor's thread uses it.

    Args:
        rig: the rig.
        on_event: called with every event of cameras and processes, and with those given to `tell`.
        on_done: called in the background thread when a job is done, to wake the supervisor.
        recorder: what the recorder does beside recording.
        hill: starts the simulated cameras; None: as the rig file says.

    Attributes:
        rig: in use; the owner may set another one of the same cameras, which counts when processes are started.
        recorder: as given.
        processes: the running processes; None while there are none, or while they are started or stopped.
        truth: writes what the simulated cameras saw; None: the cameras are real, or those that the caller started.
    """

    def __init__(
        self,
        rig: RigSettings,
        on_event: Callable[[Event], None],
        on_done: Callable[[], None],
        *,
        recorder: RecorderOptions,
        hill: StartHill | None,
    ) -> None:
        self.rig, self.recorder = rig, recorder
        self._on_event, self._on_done = on_event, on_done
        self._given_hill = hill
        self.truth: WriteTruth | None = None
        self._hill: ExitStack | None = None
        self._epoch: HostNs | None = None
        self._environment: Mapping[str, str] = {}
        self._job: Future[RigProcesses | None] | None = None
        self._worker = ThreadPoolExecutor(max_workers=1, thread_name_prefix="rig session")
        self.processes: RigProcesses | None = None
        prepare_programs(rig)

    def look(self) -> Seen:
        """What is there now; `busy` until the result of a job is collected."""
        if self.processes is not None:
            return self.processes.seen
        busy = self._job is not None
        return Seen(busy=busy, empty=not busy and self._hill is None)

    def tell(self, event: Event) -> None:
        """Pass on an event, also to the recorder, which publishes it and writes it into its log."""
        self._on_event(event)
        if self.processes is not None:
            self.processes.tell(TellEvent(event=event))

    def change_camera(self, name: str) -> None:
        """Give a camera its exposure and gain of `rig`, which are others now; not while a background job runs."""
        if self.processes is not None:
            self.processes.change_camera(self.rig, name)

    def begin_set_up(self) -> None:
        """Begin to start the simulated hill, if there is none yet, and the processes."""
        self._begin(self._set_up)

    def begin_take_down(self, *, keep_hill: bool) -> None:
        """Begin to stop the processes and, unless `keep_hill`, the simulated hill."""
        processes, self.processes = self.processes, None
        self._begin(lambda: self._take_down(processes, keep_hill=keep_hill))

    def collect(self) -> None:
        """Take over the result of a job that is done.

        Raises:
            SvevError: the job failed.
        """
        if self._job is not None and self._job.done():
            job, self._job = self._job, None
            self.processes = job.result()

    def close(self) -> None:
        """Stop everything that is left, and wait until that is done."""
        if self._job is not None:
            wait((self._job,))
            with suppress(SvevError):  # nothing to stop: starting failed
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
        """Start everything.

        Raises:
            SvevError: something cannot be started.
        """
        try:
            return self._started()
        except OSError as error:
            what = error.filename or "the processes of the rig"
            text = "{what}: cannot be started ({why}); see what this login may use: ulimit -a"
            why = error.strerror or str(error)
            raise ProcessDiedError(phrase("why_not_started", text, what=str(what), why=why)) from error

    def _started(self) -> RigProcesses:
        with ExitStack() as stack:
            if self._hill is None:
                epoch = host_now()
                start = self._given_hill or partial(hill_environment, self.rig)
                self._environment = stack.enter_context(start(epoch))
                self._epoch = epoch
            if self._given_hill is None and self._epoch is not None:
                self.truth = simulated_truth(self.rig, self._epoch)
            processes = RigProcesses(
                self.rig, self._on_event, epoch=self._epoch, recorder=self.recorder,
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
