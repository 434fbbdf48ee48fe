"""The program of a grabber process: receives the frames of one camera into its ring."""

import os
from typing import Final

from capture.grabber import Grabber
from rig.transport.child import begin
from rig.transport.grabber_messages import GrabberConfig
from rig.transport.message import Quit
from rig.transport.ring import CameraRing
from service.processes.backends import camera_opener
from service.processes.priority import allowed_priority, prefer_this_process
from triggering.sources.choice import trigger_source

#: Time to switch the camera off properly; a grabber holds no data that could be lost.
_GRACE_S: Final = 3.0


def main() -> None:
    """Grab until told to stop."""
    child = begin(GrabberConfig, Quit, _GRACE_S)
    rig, camera = child.config.rig, child.config.camera
    if rig.cameras[camera].backend not in {"sim", "replay"}:  # these draw or read images, which may take all of a core
        prefer_this_process(allowed_priority())
    ring = CameraRing(child.config.ring)
    ring.prefault()
    Grabber(
        camera_opener(rig, camera, ring, child.config.epoch),
        ring,
        child.config.doorbell,
        period_ns=rig.trigger.period_ns,
        stopping=child.stopping,
        stop_fd=child.control.fileno(),
        commands=trigger_source(rig.trigger).commands(child.config.epoch),
    ).run()
    os.close(child.config.doorbell)


if __name__ == "__main__":
    main()
