"""Sends notifications one after the other in a thread of its own, and goes on trying while the receiver is away."""

import threading
from collections import deque
from collections.abc import Callable, Iterable
from types import TracebackType
from typing import Final, Self

from rig.api.recordings import Recording
from rig.errors import SvevError
from rig.events import Event, Level
from rig.phrase import phrase
from rig.settings.webhook import WebhookSettings
from service.alarms.delivery import DEADLINE_S, Failure, deliver, read_target
from service.alarms.occasions import Notification, with_verdict

#: So many wait at most; the oldest ones are dropped.
QUEUE_MAX: Final = 100
#: Pause after the first failure, and the longest one, s; each is twice the one before.
_FIRST_PAUSE_S: Final = 1.0
_LONGEST_PAUSE_S: Final = 300.0
#: At the end of the service, what waits is sent within this time, if the receiver takes it.
_LAST_SENDING_S: Final = 3.0


class Messenger:
    """A context manager, within which the thread runs. Any thread may call `offer`; it never waits.

    Args:
        webhook: where notifications go.
        tell: takes an event when the receiver fails, and when it works again; any thread may call it.
        recording: describes a recording by its id; may take a while, and is called in the thread.
        deadline_s: longest time to connect, and to the answer, s.
        first_pause_s: pause after the first failure, s.
    """

    def __init__(
        self,
        webhook: WebhookSettings,
        tell: Callable[[Event], None],
        recording: Callable[[str], Recording],
        *,
        deadline_s: float = DEADLINE_S,
        first_pause_s: float = _FIRST_PAUSE_S,
    ) -> None:
        self._webhook, self._tell, self._recording = webhook, tell, recording
        self._deadline_s, self._first_pause_s = deadline_s, first_pause_s
        self._changed = threading.Condition()
        self._waiting: deque[tuple[Notification, str]] = deque()
        self._number = self._dropped = 0
        self._over = self._failing = False
        self._thread = threading.Thread(target=self._run, name="webhook", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with self._changed:
            self._over = True
            self._changed.notify_all()
        self._thread.join(_LAST_SENDING_S)

    def offer(self, found: Iterable[tuple[Notification, str]]) -> None:
        """Have notifications sent, each with the id of the recording that it is about; empty: of none."""
        with self._changed:
            for notification, recording in found:
                self._number += 1
                self._waiting.append((notification.model_copy(update={"number": self._number}), recording))
                if len(self._waiting) > QUEUE_MAX:
                    self._waiting.popleft()
                    self._dropped += 1
                self._changed.notify_all()

    def _run(self) -> None:
        try:
            read_target(self._webhook)
        except SvevError as error:  # said now, and not only when there is something to tell
            self._fail(Failure(error.said))
        while (found := self._next()) is not None:
            notification, recording = found
            if recording:
                notification = self._completed(notification, recording)
            if not self._send(notification):
                return

    def _next(self) -> tuple[Notification, str] | None:
        """Wait for a notification; None: the service ends and none is left."""
        with self._changed:
            while not self._waiting and not self._over:
                self._changed.wait()
            return self._waiting.popleft() if self._waiting else None

    def _completed(self, notification: Notification, recording: str) -> Notification:
        try:
            return with_verdict(notification, self._recording(recording))
        except SvevError:  # somebody has moved it away; that it ended is told all the same
            return notification

    def _send(self, notification: Notification) -> bool:
        """Send a notification again and again until the receiver has it or refuses it for good.

        Returns:
            False: the service ends, and the receiver fails.
        """
        pause_s = self._first_pause_s
        while True:
            with self._changed:
                dropped = self._dropped
            failure = self._attempt(notification.model_copy(update={"dropped": dropped}))
            if failure is None:
                self._succeed(dropped)
                return True
            self._fail(failure)
            with self._changed:
                if failure.final:
                    self._dropped += 1
                    return True
                if self._over or self._changed.wait_for(lambda: self._over, pause_s):
                    return False
            pause_s = min(2 * pause_s, _LONGEST_PAUSE_S)

    def _attempt(self, notification: Notification) -> Failure | None:
        try:
            target = read_target(self._webhook)
        except SvevError as error:
            return Failure(error.said)
        return deliver(target, notification.model_dump_json().encode(), self._deadline_s)

    def _fail(self, failure: Failure) -> None:
        """Say once that the receiver fails."""
        if not self._failing:
            self._failing = True
            said = phrase("event_webhook_fails", "notifications do not arrive: {why}", why=failure.said)
            self._tell(Event.now(Level.WARNING, "webhook", said))

    def _succeed(self, dropped: int) -> None:
        with self._changed:
            self._dropped -= dropped
        if self._failing:
            self._failing = False
            text = "notifications arrive again; {dropped} were dropped"
            said = phrase("event_webhook_works", text, dropped=dropped)
            self._tell(Event.now(Level.INFO, "webhook", said))
