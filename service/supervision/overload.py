"""Tells whether the computer is too slow for the cameras: frames come late or get lost because processes wait for it.

A camera whose frames come late or get lost may have a bad cable. If several have at once, and the processes that fetch
the frames got less than half of the processor time that they needed, the computer is at fault. The kernel measures how
long each thread was ready to run and had no processor (`/proc/PID/task/TID/schedstat`, second number; ns).
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

from rig.clocks import NS_PER_S
from rig.health import Health
from triggering.pairing.camera.activity import HELD_BACK_NS

#: Trouble of several cameras within this time is of one cause, and is stated for so long.
_TOGETHER_S: Final = 5.0
#: A camera is called silent when frames are overdue by this many periods (`triggering.pairing.pairer`), or more.
_OVERDUE_PERIODS: Final = 2
#: With longer periods than this share of the time between two looks, waiting for that share is long.
_LONG_SHARE: Final = 0.5

#: For each thread of a process: how long it ran and how long it waited for a processor so far, ns.
Waits = Mapping[int, tuple[int, int]]


def waits_of(pid: int) -> Waits:
    """Times of the threads of a process so far; none if it has ended, or if the kernel does not measure them."""
    found = {}
    for task in Path(f"/proc/{pid}/task").glob("[0-9]*"):
        try:
            ran, waited, _ = (task / "schedstat").read_text().split()
        except (OSError, ValueError):  # the thread has ended, or the kernel does not measure
            continue
        found[int(task.name)] = int(ran), int(waited)
    return found


class Overload:
    """Looks at each health record whether the computer is too slow.

    Args:
        period_ns: time between two pulses.
        measure: gives the times of a process.

    Attributes:
        cameras: indices of the cameras whose frames come late or get lost because of that; empty: it is fast enough.
    """

    def __init__(self, period_ns: int, measure: Callable[[int], Waits] = waits_of) -> None:
        self._long_ns, self._measure = max(HELD_BACK_NS, _OVERDUE_PERIODS * period_ns), measure
        self.cameras: tuple[int, ...] = ()
        self._at: float | None = None
        self._waits: dict[int, Waits] = {}
        self._troubles: list[int] = []
        self._troubled_at: dict[int, float] = {}
        self._starved_at: float | None = None

    def forget(self) -> None:
        """Start anew: there is no recorder any more."""
        self.cameras = ()
        self._at = self._starved_at = None
        self._waits, self._troubles, self._troubled_at = {}, [], {}

    def look(self, health: Health, pids: Mapping[str, int], now: float) -> None:
        """Enter a health record.

        Args:
            health: the record.
            pids: process ids by name: grabbers by their cameras, and the recorder.
            now: time of the record on the monotonic clock, s.
        """
        if self._is_any_starved(pids, now):
            self._starved_at = now
        troubles = [_troubles(health, camera) for camera in range(len(health.cameras))]
        for camera, (before, after) in enumerate(zip(self._troubles, troubles, strict=False)):
            if after > before or health.pairing.cameras[camera].silent:
                self._troubled_at[camera] = now
        self._troubles = troubles
        troubled = tuple(camera for camera, at in sorted(self._troubled_at.items()) if now <= at + _TOGETHER_S)
        starved = self._starved_at is not None and now <= self._starved_at + _TOGETHER_S
        several = len(troubled) >= min(2, len(health.cameras))
        self.cameras = troubled if starved and several else ()

    def _is_any_starved(self, pids: Mapping[str, int], now: float) -> bool:
        """Whether a thread that fetches frames has, since the last look, waited for long, and longer than it ran."""
        before, self._waits = self._waits, {pid: self._measure(pid) for pid in pids.values()}
        since, self._at = self._at, now
        if since is None:
            return False
        long_ns = min(self._long_ns, _LONG_SHARE * (now - since) * NS_PER_S)
        for pid, threads in self._waits.items():
            for thread, (ran, waited) in threads.items():
                ran_before, waited_before = before.get(pid, {}).get(thread, (ran, waited))
                longer = waited - waited_before
                if longer >= long_ns and longer > ran - ran_before:
                    return True
        return False


def _troubles(health: Health, camera: int) -> int:
    """How often a camera's frames came too late or got lost so far."""
    paired, fetched = health.pairing.cameras[camera], health.cameras[camera]
    fates = paired.late + paired.lost + paired.damaged + paired.silences
    return fates + fetched.underruns + fetched.queue_overflows
