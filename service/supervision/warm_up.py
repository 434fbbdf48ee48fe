"""How far a rig has come since it was armed, for those who wait for it."""

from dataclasses import dataclass

from rig.api.statement import Statement
from rig.api.status import State
from service.processes.rig_processes import CameraPresence


@dataclass(frozen=True, slots=True)
class WarmUp:
    """How far a rig has come since it was armed.

    Attributes:
        state: the state of the service.
        cameras: presence of each camera; None while there are no processes.
        warm: whether complete triplets have come.
        fault: why the rig is not armed; None in any other state.
    """

    state: State
    cameras: tuple[CameraPresence, ...] | None
    warm: bool
    fault: Statement | None
