"""Child process of the doctor that examines FireWire cameras and reports what it finds."""

from rig.settings.model import RigSettings
from rig.transport.child import begin
from rig.transport.message import Message, Quit
from svev.doctor.cameras.child import Found
from svev.doctor.cameras.firewire_cameras import look_at_cameras
from svev.doctor.cameras.firewire_trial import try_camera


class Examination(Message):
    """Configuration of the process.

    Attributes:
        rig: the rig.
        trial: whether to try every camera that is connected and not in use.
    """

    rig: RigSettings
    trial: bool


def main() -> None:
    """Look at the cameras, and try them."""
    child = begin(Examination, Quit, grace_s=0.0)
    rig = child.config.rig
    ready = []
    for finding, camera in look_at_cameras(rig):
        child.control.send(Found(finding=finding))
        if camera is not None:
            ready.append(camera)
    if not child.config.trial:
        return
    for camera in ready:
        for finding in try_camera(camera, rig.trigger.rate_hz):
            child.control.send(Found(finding=finding))


if __name__ == "__main__":
    main()
