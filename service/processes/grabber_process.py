"""The program of a grabber process: receives the frames of one camera into its ring."""

import os
import resource
from typing import Final

from capture.grabber import Grabber
from rig.transport.child import begin
from rig.transport.messages import GrabberConfig, Quit
from rig.transport.ring import CameraRing
from service.processes.backends import camera_opener
from triggering.sources.choice import trigger_source

_PRIORITY: Final = 10  #: above everything ordinary, below the kernel's own interrupt threads at 50


def allowed_priority() -> int:
    """The highest real-time priority that the resource limit allows; 0: none.

    The limit decides for root, too, who would not need it: a program that was started from a shell must never take a
    core from the desktop.
    """
    return resource.getrlimit(resource.RLIMIT_RTPRIO)[0]


def prefer_this_process(allowed: int) -> bool:
    """Give this process, with all threads that it will start, a real-time priority.

    A frame that the grabber does not fetch in time is lost, while everything behind the grabber can wait in buffers.

    Args:
        allowed: the highest priority to take, 0: none.

    Returns:
        Whether the process has a real-time priority now.
    """
    if allowed == 0:
        return False
    priority = _PRIORITY if allowed == resource.RLIM_INFINITY else min(allowed, _PRIORITY)
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    return True


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
