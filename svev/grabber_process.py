"""Child process: one camera. Composes back end, ring and grabber."""

import os
from typing import Final

from capture.grabber import Grabber
from rig.clocks import HostNs
from rig.ring import CameraRing
from rig.settings import RigSettings
from svev.backends import camera_opener
from svev.child import begin
from svev.scheduling import allowed_priority, prefer_this_process

#: A grabber holds nothing that could be lost; it only ought to leave its camera in order.
_GRACE_S: Final = 3.0


def main() -> None:
    """Grab until told to stop."""
    child = begin(_GRACE_S)
    rig = RigSettings.model_validate(child.config["rig"])
    if rig.cameras[child.config["camera"]].backend != "sim":  # which draws its own images, and may fall behind
        prefer_this_process(allowed_priority())
    ring = CameraRing(child.config["ring"])
    ring.prefault()
    opener = camera_opener(rig, child.config["camera"], ring, HostNs(child.config["epoch"]))
    Grabber(
        opener,
        ring,
        child.config["doorbell"],
        period_ns=rig.trigger.period_ns,
        stopping=child.stopping,
        stop_fd=child.control.fileno(),
    ).run()
    os.close(child.config["doorbell"])


if __name__ == "__main__":
    main()
