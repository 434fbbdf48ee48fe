"""The event loop of the bus process: one thread does everything on the bus, in order."""

import heapq
import select
import socket
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from itertools import count
from typing import Final, TypeVar

from rig.clocks import NS_PER_S, HostNs, host_now

_Result = TypeVar("_Result")
_CALL_S: Final = 10.0


class Loop:
    """Waits for sockets and points in time. Other threads may only use `call` and `stop`."""

    def __init__(self) -> None:
        self._readers: dict[socket.socket, Callable[[], None]] = {}
        self._writers: dict[socket.socket, Callable[[], None]] = {}
        self._due: list[tuple[HostNs, int, Callable[[], None]]] = []
        self._order = count()
        self._calls: deque[Callable[[], None]] = deque()
        self._wake, self._waker = socket.socketpair()
        self._wake.setblocking(False)
        self._stopping = False
        self.when_readable(self._wake, self._obey_calls)

    def when_readable(self, sock: socket.socket, action: Callable[[], None] | None) -> None:
        """Call `action` whenever `sock` has something to read; None: no longer."""
        _set(self._readers, sock, action)

    def when_writable(self, sock: socket.socket, action: Callable[[], None] | None) -> None:
        """Call `action` whenever `sock` has room to write; None: no longer."""
        _set(self._writers, sock, action)

    def at(self, time: HostNs, action: Callable[[], None]) -> None:
        """Call `action` at `time`, or as soon as possible if that is past."""
        heapq.heappush(self._due, (time, next(self._order), action))

    def call(self, action: Callable[[], _Result]) -> _Result:
        """From another thread: have the loop call `action`, and wait for its result.

        Raises:
            Exception: what `action` raised.
            TimeoutError: the loop did not call it in time.
        """
        future: Future[_Result] = Future()

        def obey() -> None:
            try:
                future.set_result(action())
            except Exception as error:  # noqa: BLE001  (it is the caller's)
                future.set_exception(error)

        self._calls.append(obey)
        self._waker.send(b"!")
        return future.result(_CALL_S)

    def run(self) -> None:
        """Run until `stop`."""
        while not self._stopping:
            # select() waits by the microsecond, unlike poll(): a frame arrives when it should.
            readable, writable, _ = select.select(self._readers, self._writers, (), self._patience_s())
            for action in [self._readers.get(sock) for sock in readable]:
                if action is not None:  # an earlier action may have ended the wait for a later one
                    action()
            for action in [self._writers.get(sock) for sock in writable]:
                if action is not None:
                    action()
            now = host_now()
            while self._due and self._due[0][0] <= now:
                heapq.heappop(self._due)[2]()

    def stop(self) -> None:
        """From another thread: let `run` return."""
        self.call(lambda: setattr(self, "_stopping", True))

    def close(self) -> None:
        """When `run` has returned."""
        self._wake.close()
        self._waker.close()

    def _patience_s(self) -> float | None:
        return None if not self._due else max(0, self._due[0][0] - host_now()) / NS_PER_S

    def _obey_calls(self) -> None:
        self._wake.recv(256)
        while self._calls:
            self._calls.popleft()()


def _set(
    table: dict[socket.socket, Callable[[], None]], sock: socket.socket, action: Callable[[], None] | None
) -> None:
    if action is None:
        table.pop(sock, None)
    else:
        table[sock] = action
