"""Logging in: token or session cookie, sessions of 12 hours, and the brake on clients that guess tokens."""

import hashlib
import math
import secrets
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field
from http import HTTPStatus
from typing import Final

from starlette.requests import HTTPConnection

from webpanel.door.access import Access
from webpanel.problems import ProblemError

COOKIE: Final = "svev_session"
SESSION_S = 12 * 3600.0
_SESSIONS_MAX = 200
_GUESSES_MAX = 10
_GUESSES_S = 60.0
_CLIENTS_MAX = 1000


class Sessions:
    """Session keys: random, valid for 12 hours. Only their hashes are kept."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._ends: OrderedDict[bytes, float] = OrderedDict()

    def begin(self) -> str:
        """Begin a session, and return its key. If there are too many sessions, the oldest one ends."""
        key = secrets.token_urlsafe(32)
        while len(self._ends) >= _SESSIONS_MAX:
            self._ends.popitem(last=False)
        self._ends[_digest(key)] = self._clock() + SESSION_S
        return key

    def knows(self, key: str) -> bool:
        """Whether the key belongs to a session that has not ended."""
        return self._ends.get(_digest(key), 0.0) > self._clock()

    def end(self, key: str) -> None:
        """End the session of this key, if there is one."""
        self._ends.pop(_digest(key), None)


class Brake:
    """Counts wrong tokens by client. After ten within a minute the client must wait until the minute is over."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._wrong: OrderedDict[str, tuple[int, float]] = OrderedDict()

    def seconds_to_wait(self, client: str) -> float:
        """Time until this client may try again, 0 if it may now."""
        count, ends = self._wrong.get(client, (0, 0.0))
        return max(0.0, ends - self._clock()) if count >= _GUESSES_MAX else 0.0

    def wrong(self, client: str) -> None:
        """Count a wrong token."""
        count, ends = self._wrong.pop(client, (0, 0.0))
        now = self._clock()
        self._wrong[client] = (count + 1, ends) if now < ends else (1, now + _GUESSES_S)
        if len(self._wrong) > _CLIENTS_MAX:
            self._wrong.popitem(last=False)


@dataclass(frozen=True, slots=True)
class Door:
    """Decides which clients get in: by the rules of access, open sessions and the brake."""

    access: Access
    sessions: Sessions = field(default_factory=Sessions)
    brake: Brake = field(default_factory=Brake)

    def check_token(self, candidate: str, client: str) -> None:
        """Check a token that a client gave.

        Raises:
            ProblemError: 401 it is wrong, 429 too many were wrong.
        """
        wait_s = math.ceil(self.brake.seconds_to_wait(client))
        if wait_s:
            text = f"too many wrong tokens from here: wait {wait_s} s, then try again"
            headers = {"Retry-After": str(wait_s)}
            raise ProblemError(HTTPStatus.TOO_MANY_REQUESTS, "too_many_wrong_tokens", text, headers)
        if not self.access.knows(candidate):
            self.brake.wrong(client)
            raise _unauthorized("wrong_token", "the token is wrong: take the one that the service was started with")

    def admit(self, request: HTTPConnection) -> None:
        """Check that a request carries the token or the cookie of an open session.

        Raises:
            ProblemError: 401 it carries neither, or a wrong token; 429 too many tokens were wrong.
        """
        if self.access.token is None or self.sessions.knows(request.cookies.get(COOKIE, "")):
            return
        scheme, _, candidate = request.headers.get("authorization", "").partition(" ")
        if scheme.lower() != "bearer":
            text = "this needs the token: log in on the page, or send it as Authorization: Bearer TOKEN"
            raise _unauthorized("login_required", text)
        self.check_token(candidate.strip(), client_of(request))


def client_of(request: HTTPConnection) -> str:
    """The IP address of the client."""
    return request.client.host if request.client else ""


def _unauthorized(code: str, text: str) -> ProblemError:
    return ProblemError(HTTPStatus.UNAUTHORIZED, code, text, {"WWW-Authenticate": "Bearer"})


def _digest(key: str) -> bytes:
    return hashlib.sha256(key.encode("utf-8", "surrogateescape")).digest()
