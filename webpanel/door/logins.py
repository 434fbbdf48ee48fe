"""Logging in: token or session cookie, sessions of 12 hours, and the brake on clients that guess tokens."""

import hashlib
import math
import secrets
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field
from http import HTTPStatus
from typing import Final, Literal

from starlette.requests import HTTPConnection

from rig.phrase import Phrase, phrase
from webpanel.door.access import Access, site_of
from webpanel.door.links import Links
from webpanel.door.roles import Role, needed_role, recording_in, shown_by_link
from webpanel.door.session_file import SessionFile
from webpanel.problems import ProblemError

COOKIE: Final = "svev_session"
#: Holds the key of a link; the browser sends it for the recording of the link alone.
LINK_COOKIE: Final = "svev_link"
SESSION_S = 12 * 3600.0
#: So far a clock that is kept right may step back, s.
_CLOCK_S: Final = 60.0
_SESSIONS_MAX = 200
_GUESSES_MAX = 10
_GUESSES_S = 60.0
_CLIENTS_MAX = 1000


class Sessions:
    """Session keys: random, valid for 12 hours, each with a role. Only their hashes are kept.

    Args:
        clock: UNIX time, s.
        file: keeps them beyond the end of the service; None: they end with it.
    """

    def __init__(self, clock: Callable[[], float] = time.time, file: SessionFile | None = None) -> None:
        self._clock, self._file = clock, file
        kept = () if file is None else file.load()
        self._open = OrderedDict((bytes.fromhex(digest), (role, ends)) for digest, role, ends in kept)

    def begin(self, role: Role) -> str:
        """Begin a session, and return its key. If there are too many sessions, the oldest one ends."""
        key = secrets.token_urlsafe(32)
        while len(self._open) >= _SESSIONS_MAX:
            self._open.popitem(last=False)
        self._open[_digest(key)] = role, self._clock() + SESSION_S
        self._keep()
        return key

    def role_of(self, key: str) -> Role | None:
        """The role of the session of this key, None if there is none or it has ended."""
        role, ends = self._open.get(_digest(key), (None, 0.0))
        # One with more time than a new one has was begun before the clock was set back: nobody knows how old it is.
        return role if 0 < ends - self._clock() <= SESSION_S + _CLOCK_S else None

    def end(self, key: str) -> None:
        """End the session of this key, if there is one."""
        if self._open.pop(_digest(key), None) is not None:
            self._keep()

    def _keep(self) -> None:
        if self._file is not None:
            now = self._clock()
            self._file.keep((key.hex(), role, ends) for key, (role, ends) in self._open.items() if ends > now)


class Brake:
    """Counts wrong tokens by client and token. After ten within a minute the client must wait until it is over.

    The same wrong token counts once: a program with an old token guesses nothing.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._wrong: OrderedDict[str, tuple[set[bytes], float]] = OrderedDict()

    def seconds_to_wait(self, client: str) -> float:
        """Time until this client may try again, 0 if it may now."""
        guesses, ends = self._wrong.get(client, (set(), 0.0))
        return max(0.0, ends - self._clock()) if len(guesses) >= _GUESSES_MAX else 0.0

    def wrong(self, client: str, token: str) -> int:
        """Count a wrong token.

        Returns:
            How many the client has tried within its minute, 0 if it has tried this one before.
        """
        guesses, ends = self._wrong.pop(client, (set[bytes](), 0.0))
        now = self._clock()
        if now >= ends:
            guesses, ends = set(), now + _GUESSES_S
        new = _digest(token) not in guesses
        guesses.add(_digest(token))
        self._wrong[client] = guesses, ends
        if len(self._wrong) > _CLIENTS_MAX:
            self._wrong.popitem(last=False)
        return len(guesses) if new else 0


@dataclass(frozen=True, slots=True)
class Caller:
    """Who sent a request.

    Attributes:
        role: what he may do.
        address: IP address.
        recording: id of the only recording that he may see, because he has a link to it; empty: he has a token.
    """

    role: Role
    address: str
    recording: str = ""

    def __str__(self) -> str:
        """For the live log, e.g. `operate, 192.168.1.7`."""
        return f"{self.role}, {self.address}"


@dataclass(frozen=True, slots=True)
class Door:
    """Decides which clients get in: by the rules of access, open sessions, links and the brake.

    Attributes:
        access: the rules.
        tell: takes events with their levels: logins and logouts, changes and who made them, wrong tokens.
        links: makes and checks links to single recordings; None: there are none.
    """

    access: Access
    tell: Callable[[Literal["info", "warning"], Phrase], None]
    links: Links | None = None
    sessions: Sessions = field(default_factory=Sessions)
    brake: Brake = field(default_factory=Brake)

    def check_token(self, candidate: str, client: str) -> Role:
        """The role of a token that a client gave. A right one passes whatever was guessed at the same address.

        Raises:
            ProblemError: 401 it is wrong, 429 too many were wrong.
        """
        if not self.access.tokens:
            return Role.ADMINISTER
        role = self.access.tokens.role_of(candidate)
        if role is not None:
            return role
        site = site_of(client)
        wait_s = math.ceil(self.brake.seconds_to_wait(site))
        if wait_s:
            text = f"too many wrong tokens from here: wait {wait_s} s, then try again"
            headers = {"Retry-After": str(wait_s)}
            raise ProblemError(HTTPStatus.TOO_MANY_REQUESTS, "too_many_wrong_tokens", text, headers)
        count = self.brake.wrong(site, candidate)
        if count == 1:
            self.tell("warning", phrase("event_wrong_token", "wrong token from {client}", client=client))
        elif count == _GUESSES_MAX:
            text = "{count} wrong tokens from {client} within a minute: somebody guesses; its tries are slowed down"
            self.tell("warning", phrase("event_guessing", text, count=count, client=client))
        raise _unauthorized("wrong_token", "the token is wrong: take the one that the service was started with")

    def admit(self, request: HTTPConnection) -> Caller:
        """Check that a request carries a token, the cookie of an open session, or a link's cookie for this address.

        Raises:
            ProblemError: 401 it carries none, a wrong token, or a link that has ended; 429 too many tokens were wrong.
        """
        client = self.access.client_of(request)
        if not self.access.tokens:
            return Caller(Role.ADMINISTER, client)
        scheme, _, candidate = request.headers.get("authorization", "").partition(" ")
        if scheme.lower() == "bearer":
            return Caller(self.check_token(candidate.strip(), client), client)
        role = self.sessions.role_of(request.cookies.get(COOKIE, ""))
        if role is None:
            recording, key = recording_in(request.scope["path"]), request.cookies.get(LINK_COOKIE, "")
            if recording and key:
                self.check_link(recording, key)
                return Caller(Role.WATCH, client, recording)
            text = "this needs the token: log in on the page, or send it as Authorization: Bearer TOKEN"
            raise _unauthorized("login_required", text)
        return Caller(role, client)

    def check_link(self, recording: str, key: str) -> tuple[float, float]:
        """Check the key of a link to a recording. It has too many bits to be guessed, which needs no brake.

        Returns:
            The UNIX time at which it ends, and the seconds until then.

        Raises:
            ProblemError: 401, it is none of this recording, has ended, or was taken back.
        """
        ends = None if self.links is None else self.links.ends(recording, key)
        if self.links is None or ends is None:
            raise _unauthorized("wrong_link", "this link opens nothing, or no more: scan the code of the jump again")
        if self.links.is_taken_back(recording, ends):
            raise _unauthorized("link_taken_back", "this link was taken back: ask the coach for the code of the jump")
        left_s = self.links.left_s(ends)
        if not left_s:
            raise _unauthorized("link_ended", "this link has ended: scan the code of the jump again")
        return ends, left_s


def check_role(caller: Caller, method: str, path: str) -> None:
    """Check that a caller's role, or his link, allows a call.

    Raises:
        ProblemError: 403, it does not.
    """
    if caller.recording and not shown_by_link(method, path, caller.recording):
        text = "a link shows one jump, and nothing else: log in with a token"
        raise ProblemError(HTTPStatus.FORBIDDEN, "link_forbids", text)
    needed = needed_role(method, path)
    if not caller.role.may(needed):
        text = f"your token may only {caller.role}, and this needs one that may {needed}: log in with another token"
        raise ProblemError(HTTPStatus.FORBIDDEN, "role_forbids", text)


def _unauthorized(code: str, text: str) -> ProblemError:
    return ProblemError(HTTPStatus.UNAUTHORIZED, code, text, {"WWW-Authenticate": "Bearer"})


def _digest(key: str) -> bytes:
    return hashlib.sha256(key.encode("utf-8", "surrogateescape")).digest()
