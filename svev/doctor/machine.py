"""Does the clock tell the right time, and does the processor run at full speed?"""

import ctypes
import os
from collections.abc import Iterator
from pathlib import Path

from svev.doctor.finding import Finding, Topic, passed, warning

_UNSYNCHRONIZED = 0x0040  # STA_UNSYNC, sys/timex.h
_FAST = {"performance", "schedutil", "ondemand"}


class _Timex(ctypes.Structure):
    """The first fields of `struct timex` (adjtimex(2)); the rest is room for the others."""

    _fields_ = (
        ("modes", ctypes.c_uint),
        ("offset", ctypes.c_long),
        ("freq", ctypes.c_long),
        ("maxerror", ctypes.c_long),
        ("esterror", ctypes.c_long),
        ("status", ctypes.c_int),
        ("rest", ctypes.c_byte * 256),
    )


def look_at_clock() -> Iterator[Finding]:
    """Pulses are numbered by a clock that nothing steps; the network time only dates them."""
    clock = _Timex()
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.adjtimex(ctypes.byref(clock)) < 0:
        raise OSError(ctypes.get_errno(), f"adjtimex: {os.strerror(ctypes.get_errno())}")
    if clock.status & _UNSYNCHRONIZED:
        yield warning(
            Topic.TIME,
            "the clock is not synchronized: recordings carry whatever date and time this machine believes in",
            "run: sudo apt-get install systemd-timesyncd, then wait a minute; without a network set it with `date`",
        )
    else:
        yield passed(Topic.TIME, f"the clock is synchronized, off by at most {clock.maxerror / 1000:.0f} ms")


def look_at_processor() -> Iterator[Finding]:
    """A processor that saves power wakes up late."""
    policies = sorted(Path("/sys/devices/system/cpu").glob("cpu[0-9]*/cpufreq/scaling_governor"))
    governors = {policy.read_text().strip() for policy in policies}
    cores = len(os.sched_getaffinity(0))
    if slow := governors - _FAST:
        yield warning(
            Topic.PROCESSOR,
            f"{cores} cores, governor {', '.join(sorted(slow))}: frames may wait for a core to wake up",
            "run: echo performance | sudo tee /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor",
        )
    else:
        told = ", ".join(sorted(governors)) or "none (the machine below this one decides)"
        yield passed(Topic.PROCESSOR, f"{cores} cores, governor: {told}")
    if cores < 2:
        yield warning(Topic.PROCESSOR, "one core for all cameras", "use a machine with at least two cores")
