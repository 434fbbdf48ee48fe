"""Waits for points of the host's clock, precisely, and until somebody ends the waiting."""

import ctypes
import os
import select
from types import TracebackType
from typing import Final, Protocol, Self

from rig.clocks import NS_PER_S, HostNs, host_now

_CLOCK_MONOTONIC: Final = 1
_NONBLOCK_CLOEXEC: Final = os.O_NONBLOCK | os.O_CLOEXEC
_ABSOLUTE: Final = 1
#: The thread wakes so long before a precise moment and spends the rest of it awake: a computer that does nothing else
#: takes about so long to wake one.
_EARLY_NS: Final = 200_000


class Waiting(Protocol):
    """A clock and the waiting for its times."""

    def now(self) -> HostNs:
        """Present time."""
        ...

    def wait(self, until: HostNs, *, precisely: bool) -> bool:
        """Wait; whether to go on then.

        Args:
            until: end of the wait.
            precisely: end it as near to that as can be.
        """
        ...


class _Spec(ctypes.Structure):
    """`struct itimerspec`: no interval, and the moment."""

    _fields_ = [(name, ctypes.c_long) for name in ("every_s", "every_ns", "at_s", "at_ns")]


class Timer:
    """Waits on a kernel timer for absolute times, so that no delay on the way to the wait adds to it; see `Waiting`.

    A context manager.
    """

    def __init__(self) -> None:
        self._libc = ctypes.CDLL(None, use_errno=True)

    def __enter__(self) -> Self:
        self._timer = self._libc.timerfd_create(_CLOCK_MONOTONIC, _NONBLOCK_CLOEXEC)
        if self._timer < 0:
            raise OSError(ctypes.get_errno(), "timerfd_create")
        self._end = os.eventfd(0, os.EFD_CLOEXEC | os.EFD_NONBLOCK)
        self._poll = select.poll()
        self._poll.register(self._timer, select.POLLIN)
        self._poll.register(self._end, select.POLLIN)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        os.close(self._timer)
        os.close(self._end)

    def now(self) -> HostNs:
        """See `Waiting.now`."""
        return host_now()

    def wait(self, until: HostNs, *, precisely: bool) -> bool:
        """See `Waiting.wait`."""
        at = until - _EARLY_NS if precisely else until
        spec = _Spec(0, 0, *divmod(max(1, at), NS_PER_S))
        if self._libc.timerfd_settime(self._timer, _ABSOLUTE, ctypes.byref(spec), None) < 0:
            raise OSError(ctypes.get_errno(), "timerfd_settime")
        if any(descriptor == self._end for descriptor, _ in self._poll.poll()):
            return False
        while precisely and host_now() < until:
            pass
        return True

    def end(self) -> None:
        """From any thread: end the present wait and all later ones."""
        os.eventfd_write(self._end, 1)
