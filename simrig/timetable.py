"""A thread that does things at given times of the host clock."""

import heapq
import threading
from collections.abc import Callable
from itertools import count

from rig.clocks import NS_PER_S, HostNs, host_now

_STOP_S = 30.0


class Timetable:
    """Actions by time. The thread begins with the first one and ends with `stop`."""

    def __init__(self) -> None:
        self._condition = threading.Condition()
        self._due: list[tuple[HostNs, int, Callable[[], None]]] = []
        self._order = count()
        self._stopping = False
        self._thread: threading.Thread | None = None

    def add(self, time: HostNs, action: Callable[[], None]) -> None:
        """Do `action` at `time`, at once if that is past; nothing happens after `stop`."""
        with self._condition:
            if self._stopping:
                return
            heapq.heappush(self._due, (time, next(self._order), action))
            self._condition.notify_all()
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="timetable")
                self._thread.start()

    def stop(self) -> None:
        """Do nothing more; returns when the action under way is done."""
        with self._condition:
            self._stopping = True
            self._condition.notify_all()
        if self._thread is not None:
            self._thread.join(_STOP_S)

    def _run(self) -> None:
        while (action := self._next()) is not None:
            action()

    def _next(self) -> Callable[[], None] | None:
        """Wait for the next action; None when stopping."""
        with self._condition:
            while not self._stopping:
                if not self._due:
                    self._condition.wait()
                elif (early_ns := self._due[0][0] - host_now()) > 0:
                    self._condition.wait(early_ns / NS_PER_S)
                else:
                    return heapq.heappop(self._due)[2]
        return None
