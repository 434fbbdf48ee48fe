"""The messages between the service and a grabber process."""

from rig.clocks import HostNs
from rig.settings.model import RigSettings
from rig.transport.message import Message


class GrabberConfig(Message):
    """Configuration of a grabber process.

    Attributes:
        rig: the rig.
        camera: index of the camera to grab from.
        ring: descriptor of the camera's ring.
        doorbell: eventfd that wakes the recorder.
        epoch: host time of the simulated hill's pulse 0, of a replay's first pulse, and of a pulse that is a command.
    """

    rig: RigSettings
    camera: int
    ring: int
    doorbell: int
    epoch: HostNs
