"""Sessions of those who gave the token once, and the brake on those who guess."""

import hashlib
import secrets
import time
from collections import OrderedDict
from collections.abc import Callable

SESSION_S = 12 * 3600.0
_SESSIONS_MAX = 200
_GUESSES_MAX = 10
_GUESSES_S = 60.0
_CLIENTS_MAX = 1000


class Sessions:
    """Random session keys, each good for 12 hours. Only their hashes are kept."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._ends: OrderedDict[bytes, float] = OrderedDict()

    def begin(self) -> str:
        """A new session's key. With too many sessions the oldest one ends."""
        key = secrets.token_urlsafe(32)
        while len(self._ends) >= _SESSIONS_MAX:
            self._ends.popitem(last=False)
        self._ends[_digest(key)] = self._clock() + SESSION_S
        return key

    def knows(self, key: str) -> bool:
        """Whether this is the key of a session that has not ended."""
        return self._ends.get(_digest(key), 0.0) > self._clock()

    def end(self, key: str) -> None:
        """End a session; an unknown one is none."""
        self._ends.pop(_digest(key), None)


class Brake:
    """Counts wrong tokens by client; after ten within a minute the client must wait until the minute is over."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._wrong: OrderedDict[str, tuple[int, float]] = OrderedDict()

    def seconds_to_wait(self, client: str) -> float:
        """How long until this client may try again, 0 if now."""
        count, ends = self._wrong.get(client, (0, 0.0))
        return max(0.0, ends - self._clock()) if count >= _GUESSES_MAX else 0.0

    def wrong(self, client: str) -> None:
        """Note a wrong token."""
        count, ends = self._wrong.pop(client, (0, 0.0))
        now = self._clock()
        self._wrong[client] = (count + 1, ends) if now < ends else (1, now + _GUESSES_S)
        if len(self._wrong) > _CLIENTS_MAX:
            self._wrong.popitem(last=False)


def _digest(key: str) -> bytes:
    return hashlib.sha256(key.encode("utf-8", "surrogateescape")).digest()
