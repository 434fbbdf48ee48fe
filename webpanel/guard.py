"""Looks at every request before anything else does: name called, page it comes from, token; and guards every answer."""

import math
from dataclasses import dataclass, field
from http import HTTPStatus
from typing import Final
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.exceptions import HTTPException
from starlette.requests import HTTPConnection
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from webpanel.access import Access
from webpanel.logins import Brake, Sessions
from webpanel.problems import ProblemError, problem
from webpanel.security_headers import SECURITY_HEADERS

COOKIE: Final = "svev_session"
BODY_MAX: Final = 64 * 1024
HEAD_MAX: Final = 16 * 1024
_HEADER_COST: Final = 32  # what a header takes beside its text (RFC 9113, 6.5.2)
_TOO_LARGE: Final = f"the request's body is too large: no call needs more than {BODY_MAX // 1024} KiB"
_READING: Final = frozenset({"GET", "HEAD", "OPTIONS"})
#: Behind these stands something to protect; the page itself may be seen by everybody, it has to ask for the token.
_PROTECTED: Final = ("/api/", "/metrics", "/docs", "/openapi.json")
_OPEN: Final = frozenset({"/api/login", "/api/logout"})


@dataclass(frozen=True, slots=True)
class Door:
    """Access, with those who are inside and those who knock too often."""

    access: Access
    sessions: Sessions = field(default_factory=Sessions)
    brake: Brake = field(default_factory=Brake)

    def check_token(self, candidate: str, client: str) -> None:
        """Let a client in who knows the token.

        Raises:
            ProblemError: 401 wrong token, 429 too many of them.
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
        """See that a request has the token, or the cookie of a login.

        Raises:
            ProblemError: 401 neither; 429 too many wrong tokens.
        """
        if self.access.token is None or self.sessions.knows(request.cookies.get(COOKIE, "")):
            return
        scheme, _, candidate = request.headers.get("authorization", "").partition(" ")
        if scheme.lower() != "bearer":
            text = "this needs the token: log in on the page, or send it as Authorization: Bearer TOKEN"
            raise _unauthorized("login_required", text)
        self.check_token(candidate.strip(), client_of(request))


class Guard:
    """ASGI middleware: refuses what has no business here, and puts the security headers on every answer."""

    def __init__(self, app: ASGIApp, door: Door) -> None:
        self._app = app
        self._door = door

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """One request."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return

        protected = scope["path"].startswith(_PROTECTED)

        async def send_guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in SECURITY_HEADERS.items():
                    headers.setdefault(name, value)
                # The page's files are asked for again each time, but sent only if they have changed.
                headers.setdefault("cache-control", "no-store" if protected else "no-cache")
            await send(message)

        try:
            self._check(HTTPConnection(scope))
        except ProblemError as error:
            await problem(error.status, error.code, error.detail, error.headers)(scope, receive, send_guarded)
        else:
            await self._app(scope, _bounded(scope, receive), send_guarded)

    def _check(self, request: HTTPConnection) -> None:
        """Raises ProblemError if the request is not to be answered."""
        _check_size(request.scope)
        headers, path, reading = request.headers, request.scope["path"], request.scope["method"] in _READING
        check_host(request, self._door.access)
        if not reading or (path.startswith("/api/") and headers.get("sec-fetch-mode") != "navigate"):
            _check_origin(headers)
        if path.startswith(_PROTECTED) and path not in _OPEN:
            self._door.admit(request)
        _check_body(headers, reading=reading)


def check_host(request: HTTPConnection, access: Access) -> None:
    """See that the client calls the service by its name.

    Raises:
        ProblemError: it does not.
    """
    hosts = request.headers.getlist("host")
    server = request.scope.get("server") or ("", None)
    if len(hosts) != 1 or not access.allows_host(hosts[0], server[0]):
        text = "the service is not called by this name: use its address, or start it with --allow-host NAME"
        raise ProblemError(HTTPStatus.BAD_REQUEST, "unknown_host", text)


def client_of(request: HTTPConnection) -> str:
    """The client's address."""
    return request.client.host if request.client else ""


def _check_size(scope: Scope) -> None:
    size = len(scope["raw_path"]) + len(scope["query_string"])
    size += sum(len(name) + len(value) + _HEADER_COST for name, value in scope["headers"])
    if size > HEAD_MAX:
        text = f"address and headers of the request are too large: {HEAD_MAX // 1024} KiB are enough for every call"
        raise ProblemError(HTTPStatus.REQUEST_HEADER_FIELDS_TOO_LARGE, "request_head_too_large", text)


def _check_origin(headers: Headers) -> None:
    """Browsers say from which page a request comes; programs do not."""
    origins = headers.getlist("origin")
    foreign = headers.get("sec-fetch-site", "same-origin") not in {"same-origin", "none"}
    if foreign or any(_authority(origin) != headers["host"].lower() for origin in origins):
        text = "the request comes from a page of another site: use the page of this service"
        raise ProblemError(HTTPStatus.FORBIDDEN, "foreign_origin", text)


def _authority(origin: str) -> str:
    try:
        parts = urlsplit(origin)
    except ValueError:
        return ""
    return parts.netloc.lower() if parts.scheme in {"http", "https"} else ""


def _check_body(headers: Headers, *, reading: bool) -> None:
    length = headers.get("content-length", "0")
    if length.isdecimal() and int(length[:20]) > BODY_MAX:
        raise ProblemError(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, "request_entity_too_large", _TOO_LARGE)
    has_body = length != "0" or "transfer-encoding" in headers
    media_type = headers.get("content-type", "").partition(";")[0].strip().lower()
    if has_body and not reading and media_type != "application/json":
        text = "the body must be JSON: send Content-Type: application/json"
        raise ProblemError(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, "unsupported_media_type", text)


def _bounded(scope: Scope, receive: Receive) -> Receive:
    """The same, for a body that does not say how long it is."""
    reading = scope["method"] in _READING
    received = 0

    async def receive_bounded() -> Message:
        nonlocal received
        message = await receive()
        received += len(message.get("body", b""))
        if reading:
            return {**message, "body": b""}  # means nothing here, however much it is
        if received > BODY_MAX:
            # The one kind of error that the framework hands on while it reads a body.
            raise HTTPException(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, _TOO_LARGE)
        return message

    return receive_bounded


def _unauthorized(code: str, text: str) -> ProblemError:
    return ProblemError(HTTPStatus.UNAUTHORIZED, code, text, {"WWW-Authenticate": "Bearer"})
