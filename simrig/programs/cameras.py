"""The owner's side of simulated cameras: their processes, and each camera whatever bus it is on."""

import signal
from collections.abc import Callable
from typing import Final, TypeVar

from rig.errors import BadInputError
from rig.transport.message import Message, Quit
from rig.transport.process_table import Child, ProcessSpec
from simrig.programs.messages import (
    Answer,
    AskStatistics,
    Done,
    Freeze,
    Inject,
    Plug,
    Refused,
    Statistics,
    Thaw,
    Unplug,
)
from simrig.world.faults import ON_FIREWIRE, ON_GIGE, Fault, FaultKind
from simrig.world.statistics import CameraStatistics

START_S: Final = 30.0
_ANSWER_S: Final = 10.0
_STOP_S: Final = 3.0

Wanted = TypeVar("Wanted", bound=Message)


class CameraProcess:
    """A process of simulated cameras: one GigE Vision camera, or the FireWire bus with all its cameras.

    Args:
        name: name of the process in messages.
        module: program to run.
        config: its configuration.
        launch: starts it in a thread that lives as long as the process shall live.
    """

    def __init__(self, name: str, module: str, config: Message, launch: Callable[[ProcessSpec], Child]) -> None:
        self._spec = ProcessSpec(name, module, config, reports=Answer, own_group=True)
        self._launch = launch
        self._child: Child | None = None

    @property
    def pid(self) -> int | None:
        """Process id; None if the process does not run."""
        return self._child.pid if self._child is not None and self._child.ending() is None else None

    def start(self) -> None:
        """Start the process, without waiting until it is ready."""
        self._child = self._launch(self._spec)

    def await_ready(self) -> None:
        """Wait until the cameras of a started process answer.

        Raises:
            BadInputError: they cannot, for a reason that a person can remove.
            ProcessDiedError: the process ended, or took too long.
        """
        self._hear(Done, START_S)

    def ask(self, command: Message, wanted: type[Wanted]) -> Wanted:
        """Send a command and wait for the answer, which is of type `wanted`.

        Raises:
            BadInputError: the process refuses the command.
            ProcessDiedError: it does not answer.
        """
        self._running().control.send(command)
        return self._hear(wanted, _ANSWER_S)

    def send_signal(self, number: int) -> None:
        """Send a signal to the process."""
        self._running().send_signal(number)

    def begin_stop(self) -> None:
        """Ask the process, frozen or not, to end, without waiting for it."""
        if self._child is not None:
            self._child.send_signal(signal.SIGCONT)
            self._child.control.send(Quit())

    def stop(self) -> None:
        """End the process: politely, then by force."""
        self.begin_stop()
        if self._child is not None:
            self._child.stop(_STOP_S)
            self._child = None

    def kill(self) -> None:
        """End the process by force."""
        if self._child is not None:
            self._child.kill()
            self._child = None

    def _running(self) -> Child:
        assert self._child is not None, "started"  # noqa: S101  (SimulatedHill does not ask dead processes)
        return self._child

    def _hear(self, wanted: type[Wanted], patience_s: float) -> Wanted:
        answer = self._running().answer(patience_s)
        if isinstance(answer, Refused):
            raise BadInputError(answer.reason)
        assert isinstance(answer, wanted)  # noqa: S101  (each command has one type of answer)
        return answer


class HillCamera:
    """One camera of the simulated hill. A GigE Vision camera is a process of its own; FireWire cameras share the bus's.

    Every method may raise ProcessDiedError: the process ended by itself or does not answer.

    Args:
        name: name of the camera in the scenario.
        process: its process.
        on_bus: whether it is on the FireWire bus.

    Attributes:
        killed: whether it was killed and not restarted.
        frozen: whether it was frozen and not thawed.
    """

    def __init__(self, name: str, process: CameraProcess, *, on_bus: bool) -> None:
        self._name, self._process, self._on_bus = name, process, on_bus
        self.killed = self.frozen = False

    @property
    def kinds(self) -> frozenset[FaultKind]:
        """Faults that it can have."""
        return ON_FIREWIRE if self._on_bus else ON_GIGE

    @property
    def pid(self) -> int | None:
        """Process id; None if the process does not run or the camera is unplugged."""
        return None if self.killed else self._process.pid

    def inject(self, fault: Fault) -> None:
        """Add a fault of single frames.

        Raises:
            BadInputError: the fault's pulses are past.
        """
        self._process.ask(Inject(fault=fault), Done)

    def statistics(self) -> CameraStatistics:
        """What the camera did since its process began."""
        return self._process.ask(AskStatistics(camera=self._name), Statistics).statistics

    def kill(self) -> None:
        """Cut the camera's power: kill its process, or unplug it from the bus."""
        if self._on_bus:
            self._process.ask(Unplug(camera=self._name), Done)
        else:
            self._process.kill()
        self.killed, self.frozen = True, False

    def restart(self) -> None:
        """Kill the camera if it is alive, start it with default settings, and wait until it is ready.

        Raises:
            BadInputError: its address has been taken meanwhile.
        """
        if self._on_bus:
            self._process.ask(Plug(camera=self._name), Done)
        else:
            self._process.kill()
            self._process.start()
            self._process.await_ready()
        self.killed = self.frozen = False

    def freeze(self) -> None:
        """Let the camera answer nothing and send nothing."""
        if self._on_bus:
            self._process.ask(Freeze(camera=self._name), Done)
        else:
            self._process.send_signal(signal.SIGSTOP)
        self.frozen = True

    def thaw(self) -> None:
        """Let the camera go on; does nothing if it is not frozen."""
        if not self.frozen:
            return
        if self._on_bus:
            self._process.ask(Thaw(camera=self._name), Done)
        else:
            self._process.send_signal(signal.SIGCONT)
        self.frozen = False
