"""Real-time scheduling for the grabbers, where the machine's owner allows it (`LimitRTPRIO=` of the systemd unit)."""

import os
import resource
from typing import Final

_PRIORITY: Final = 10  #: above everything ordinary, below the kernel's own interrupt threads at 50


def allowed_priority() -> int:
    """The highest real-time priority that the resource limit grants; 0: none.

    Root could take one without the limit. The limit alone decides all the same: a program that was started from a
    shell never takes a core from the desktop.
    """
    return resource.getrlimit(resource.RLIMIT_RTPRIO)[0]


def prefer_this_process(allowed: int) -> bool:
    """Run this process before every ordinary one, threads to come included.

    A frame that is not fetched in time is lost, while all that comes after the grabber waits in buffers.

    Args:
        allowed: the highest priority to take.

    Returns:
        Whether it does so now.
    """
    if allowed == 0:
        return False
    priority = _PRIORITY if allowed == resource.RLIM_INFINITY else min(allowed, _PRIORITY)
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    return True
