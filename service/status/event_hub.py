"""The live log of the service: numbers events, keeps the last thousand, wakes those who listen."""

import threading
from collections import deque
from collections.abc import Callable
from datetime import UTC, datetime
from typing import Final

from rig import events
from rig.api.status import Event
from rig.clocks import NS_PER_S

_KEPT: Final = 1000


class EventHub:
    """The live log. Any thread may call any method.

    Args:
        write_line: called with every event, e.g. to print it.
    """

    def __init__(self, write_line: Callable[[events.Event], None]) -> None:
        self._write_line = write_line
        self._lock = threading.RLock()  # a listener that is being woken may ask for events or stop listening
        self._events: deque[Event] = deque(maxlen=_KEPT)
        self._number = 0
        self._listeners: dict[object, Callable[[], None]] = {}

    def tell(self, event: events.Event) -> None:
        """Number an event, keep it, pass it to `write_line`, wake the listeners."""
        with self._lock:
            self._number += 1
            time = datetime.fromtimestamp(event.time / NS_PER_S, UTC)
            self._events.append(
                Event(
                    number=self._number, time=time, level=event.level.value, name=event.name,
                    message=event.message, code=event.code, values=event.values,
                )
            )  # fmt: skip
            self._write_line(event)
        self.wake()

    def after(self, number: int) -> list[Event]:
        """The events with higher numbers that are still kept, oldest first."""
        with self._lock:
            return [event for event in self._events if event.number > number]

    def listen(self, wake: Callable[[], None]) -> Callable[[], None]:
        """Call `wake` at every event and every change of the status.

        Args:
            wake: must return at once: it is called under the lock.

        Returns:
            A function that ends the calls; once it has returned, `wake` is not called any more.
        """
        ticket = object()
        with self._lock:
            self._listeners[ticket] = wake

        def end() -> None:
            with self._lock:
                self._listeners.pop(ticket, None)

        return end

    def wake(self) -> None:
        """Call all listeners."""
        with self._lock:
            for listener in list(self._listeners.values()):
                listener()
