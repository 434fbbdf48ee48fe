"""A camera of the simulated hill as its owner handles it, whatever bus it is on."""

from collections.abc import Callable
from typing import Protocol

from pydantic import BaseModel

from simrig.camera_process import CameraProcess
from simrig.faults import Fault, FaultKind
from simrig.statistics import CameraStatistics

#: Starts a process in a thread that lives long enough: module, configuration, what to call it.
Launch = Callable[[str, BaseModel, str], CameraProcess]


class HillCamera(Protocol):
    """One camera. Every method may raise ProcessDiedError: its process ended by itself or does not answer."""

    @property
    def kinds(self) -> frozenset[FaultKind]:
        """What can go wrong with it."""
        ...

    @property
    def pid(self) -> int | None:
        """Its process, None if that does not run."""
        ...

    @property
    def killed(self) -> bool:
        """Whether it was ended by force and not started again."""
        ...

    @property
    def frozen(self) -> bool:
        """Whether it was frozen and not thawed."""
        ...

    def start(self) -> None:
        """Begin to start it."""
        ...

    def await_ready(self) -> None:
        """Wait until it is there.

        Raises:
            BadInputError: it cannot be, for a reason that somebody can remove.
        """
        ...

    def inject(self, fault: Fault) -> None:
        """Let something go wrong.

        Raises:
            BadInputError: the fault's pulses are past.
        """
        ...

    def kill(self) -> None:
        """End it, as if its power were cut."""
        ...

    def restart(self) -> None:
        """Kill it if it is alive, then start it with default settings; returns when it is there."""
        ...

    def freeze(self) -> None:
        """Let it answer nothing and send nothing."""
        ...

    def thaw(self) -> None:
        """Let it go on; nothing happens if it is not frozen."""
        ...

    def statistics(self) -> CameraStatistics:
        """What it did since its process began."""
        ...

    def begin_stop(self) -> None:
        """Ask it to end, without waiting for it."""
        ...

    def stop(self) -> None:
        """End it; by force after a while."""
        ...
