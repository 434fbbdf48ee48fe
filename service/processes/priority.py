"""Lets a process come before ordinary ones: those that fetch frames, and those that make pulses."""

import os
import resource
from typing import Final

#: Above everything ordinary, below the kernel's own interrupt threads at 50.
FETCHING_FRAMES: Final = 10
#: Above those, too: a frame waits in a buffer, a pulse nowhere.
MAKING_PULSES: Final = 15


def allowed_priority() -> int:
    """The highest real-time priority that the resource limit allows; 0: none.

    The limit decides for root, too, who would not need it: a program that was started from a shell must never take a
    core from the desktop.
    """
    return resource.getrlimit(resource.RLIMIT_RTPRIO)[0]


def prefer_this_process(allowed: int, wanted: int = FETCHING_FRAMES) -> bool:
    """Give this process, with all threads that it will start, a real-time priority.

    A frame that the grabber does not fetch in time is lost, while everything behind the grabber can wait in buffers.

    Args:
        allowed: the highest priority to take, 0: none.
        wanted: the priority to take if that is allowed.

    Returns:
        Whether the process has a real-time priority now.
    """
    if allowed == 0:
        return False
    priority = wanted if allowed == resource.RLIM_INFINITY else min(allowed, wanted)
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    return True
