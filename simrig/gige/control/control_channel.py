"""Who may control the camera: control channel privilege and heartbeat (GigE Vision 2.0, chapter 10)."""

from rig.clocks import HostNs
from simrig.gige.protocol.gvcp import Status
from simrig.gige.registers.register_map import RegisterError

EXCLUSIVE = 0x1
CONTROL = 0x2
Peer = tuple[str, int]


class ControlChannel:
    """Keeps track of the camera's controller, which loses the camera when it falls silent.

    The class has no clock and no socket: its caller says what happens and when.
    """

    def __init__(self) -> None:
        self.controller: Peer | None = None
        self.privilege = 0
        self._heard = HostNs(0)

    def heard(self, peer: Peer, now: HostNs) -> None:
        """A peer sent a command; any command of the controller is a heartbeat."""
        if peer == self.controller:
            self._heard = now

    def claim(self, peer: Peer, privilege: int, now: HostNs) -> None:
        """Take, change or give up control, as a write to GevCCP does.

        Raises:
            RegisterError: another peer has control.
        """
        if self.controller not in (None, peer):
            raise RegisterError(Status.ACCESS_DENIED)
        self.privilege = privilege & (EXCLUSIVE | CONTROL)
        self.controller = peer if self.privilege else None
        self._heard = now

    def release(self) -> None:
        """Take control away from the controller."""
        self.controller, self.privilege = None, 0

    def check_read(self, peer: Peer) -> None:
        """Any peer may read, unless another one has exclusive access.

        Raises:
            RegisterError: `peer` may not.
        """
        if self.privilege & EXCLUSIVE and peer != self.controller:
            raise RegisterError(Status.ACCESS_DENIED)

    def check_write(self, peer: Peer) -> None:
        """Only the controller may write.

        Raises:
            RegisterError: `peer` may not.
        """
        if peer != self.controller:
            raise RegisterError(Status.ACCESS_DENIED)

    def silent_at(self, timeout_ns: int) -> HostNs | None:
        """When the controller's silence reaches the timeout; None without a controller."""
        return None if self.controller is None else HostNs(self._heard + timeout_ns)
