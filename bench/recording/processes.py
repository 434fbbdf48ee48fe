"""CPU time of processes, from the kernel's own accounts."""

import ctypes
import os
import time
from collections.abc import Iterable

_LIBC = ctypes.CDLL(None, use_errno=True)


def cpu_seconds(pids: Iterable[int]) -> float:
    """User plus system time of all threads of some processes, seconds, to the nanosecond.

    Raises:
        OSError: a process is gone.
    """
    return sum(_cpu_seconds(pid) for pid in pids)


def _cpu_seconds(pid: int) -> float:
    # /proc/PID/stat counts in ticks of 10 ms: a baseline of some milliseconds would be 0.
    clock = ctypes.c_int()
    error = _LIBC.clock_getcpuclockid(ctypes.c_int(pid), ctypes.byref(clock))
    if error:
        raise OSError(error, os.strerror(error), f"CPU time of process {pid}")
    return time.clock_gettime(clock.value)
