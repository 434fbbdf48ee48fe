"""Checks every request before a route sees it: size, Host, Origin, token, body; puts security headers on answers."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from http import HTTPStatus
from typing import Final
from urllib.parse import urlsplit

from starlette.concurrency import run_in_threadpool
from starlette.datastructures import Headers, MutableHeaders
from starlette.exceptions import HTTPException
from starlette.requests import HTTPConnection
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from rig.api.digitizing import MARKS_BYTES_MAX
from rig.api.looking import VOICE_BYTES_MAX
from rig.api.start_list import TABLE_BYTES_MAX
from rig.phrase import phrase
from webpanel.door.access import Access
from webpanel.door.logins import Caller, Door, check_role
from webpanel.door.roles import READING, act
from webpanel.problems import SECURITY_HEADERS, ProblemError

BODY_MAX: Final = 64 * 1024
HEAD_MAX: Final = 16 * 1024
_HEADER_COST: Final = 32  # bytes that a header counts beside its text (RFC 9113, 6.5.2)
#: Paths that need the token. The page's files do not: the page has to ask for the token.
PROTECTED: Final = ("/api/", "/metrics", "/docs", "/openapi.json")
OPEN: Final = frozenset({"/api/login", "/api/login/link", "/api/logout"})


@dataclass(frozen=True, slots=True)
class _Body:
    """What a body may be.

    Attributes:
        path: pattern of the paths that take it.
        media_type: what it is.
        most: so many bytes at most.
    """

    path: re.Pattern[str]
    media_type: str
    most: int = BODY_MAX


#: Of programs that know no other kind: the content tells what it is.
ANY_BYTES: Final = "application/octet-stream"
_JSON: Final = _Body(re.compile(".*"), "application/json")
#: Bodies that are something else than JSON; the routes look which call takes what.
_OTHERS: Final = (
    *(
        _Body(re.compile("/api/start-list(?:/preview)?"), kind, TABLE_BYTES_MAX)
        for kind in ("text/csv", "application/vnd.openxmlformats-officedocument.spreadsheetml.sheet", ANY_BYTES)
    ),
    *(
        _Body(re.compile("/api/recordings/[^/]+/digitizing/sessions/[^/]+/import"), kind, MARKS_BYTES_MAX)
        for kind in ("application/json", "text/csv", "application/zip")
    ),
    *(
        _Body(re.compile("/api/recordings/[^/]+/voice-notes"), kind, VOICE_BYTES_MAX)
        for kind in ("audio/webm", ANY_BYTES)
    ),
)


class Guard:
    """ASGI middleware: answers requests that fail a check with a problem, and adds the security headers.

    Args:
        app: what it guards.
        door: decides who gets in.
        visit: asked, with recording and path, for each call of somebody who has a link; raises ProblemError if what he
            asks for is not to be had now.
    """

    def __init__(self, app: ASGIApp, door: Door, visit: Callable[[str, str], None]) -> None:
        self._app = app
        self._door = door
        self._visit = visit

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """One request."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return

        protected = scope["path"].startswith(PROTECTED)
        caller: Caller | None = None

        async def send_guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                for name, value in SECURITY_HEADERS.items():
                    headers.setdefault(name, value)
                # The browser asks for the page's files each time, but gets only those that have changed.
                headers.setdefault("cache-control", "no-store" if protected else "no-cache")
                changed = scope["method"] not in READING and message["status"] < HTTPStatus.BAD_REQUEST
                done = act(scope["method"], scope["path"]) if changed and caller is not None else None
                if done is not None:
                    said = phrase("event_act", "{act} ({caller})", act=done, caller=str(caller))
                    await run_in_threadpool(self._door.tell, "info", said)
            await send(message)

        try:
            caller = self._check(HTTPConnection(scope))
            if caller is not None and caller.recording:
                await run_in_threadpool(self._visit, caller.recording, scope["path"])
        except ProblemError as error:
            await error.answer()(scope, receive, send_guarded)
        else:
            scope.setdefault("state", {})["caller"] = caller
            await self._app(scope, _bounded(scope, receive, _body_of(scope)), send_guarded)

    def _check(self, request: HTTPConnection) -> Caller | None:
        """Who calls, None where nobody needs a token; raise ProblemError if the request is to be refused."""
        _check_size(request.scope)
        headers, path, reading = request.headers, request.scope["path"], request.scope["method"] in READING
        check_host(request, self._door.access)
        if not reading or (path.startswith("/api/") and headers.get("sec-fetch-mode") != "navigate"):
            _check_origin(headers)
        caller = None
        if path.startswith(PROTECTED) and path not in OPEN:
            caller = self._door.admit(request)
            check_role(caller, request.scope["method"], path)
        _check_body(headers, _body_of(request.scope), reading=reading)
        return caller


def check_host(request: HTTPConnection, access: Access) -> None:
    """Check that the Host header names this service.

    Raises:
        ProblemError: 400, it names another one.
    """
    hosts = request.headers.getlist("host")
    server = request.scope.get("server") or ("", None)
    if len(hosts) != 1 or not access.allows_host(hosts[0], server[0]):
        text = "the service is not called by this name: use its address, or start it with --allow-host NAME"
        raise ProblemError(HTTPStatus.BAD_REQUEST, "unknown_host", text)


def _check_size(scope: Scope) -> None:
    size = len(scope["raw_path"]) + len(scope["query_string"])
    size += sum(len(name) + len(value) + _HEADER_COST for name, value in scope["headers"])
    if size > HEAD_MAX:
        text = f"address and headers of the request are too large: {HEAD_MAX // 1024} KiB are enough for every call"
        raise ProblemError(HTTPStatus.REQUEST_HEADER_FIELDS_TOO_LARGE, "request_head_too_large", text)


def _check_origin(headers: Headers) -> None:
    """Refuse requests that a browser sends for a page of another site. Programs send no such headers."""
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


def _body_of(scope: Scope) -> _Body:
    """What the body of a request may be, by its path and by what it says that it is."""
    kind, path = _media_type(Headers(scope=scope)), scope["path"]
    return next((body for body in _OTHERS if body.media_type == kind and body.path.fullmatch(path)), _JSON)


def _media_type(headers: Headers) -> str:
    return headers.get("content-type", "").partition(";")[0].strip().lower()


def _too_large(body: _Body) -> str:
    return f"the request's body is too large: no call needs more than {body.most // 1024} KiB"


def _check_body(headers: Headers, body: _Body, *, reading: bool) -> None:
    length = headers.get("content-length", "0")
    if length.isdecimal() and int(length[:20]) > body.most:
        raise ProblemError(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, "request_entity_too_large", _too_large(body))
    has_body = length != "0" or "transfer-encoding" in headers
    if has_body and not reading and _media_type(headers) != body.media_type:
        text = "the body must be JSON: send Content-Type: application/json"
        raise ProblemError(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, "unsupported_media_type", text)


def _bounded(scope: Scope, receive: Receive, body: _Body) -> Receive:
    """The size limit for a body whose length is not announced; a body of GET, HEAD and OPTIONS is dropped."""
    reading = scope["method"] in READING
    received = 0

    async def receive_bounded() -> Message:
        nonlocal received
        message = await receive()
        received += len(message.get("body", b""))
        if reading:
            return {**message, "body": b""}
        if received > body.most:
            # The framework passes on no other error while it reads a body.
            raise HTTPException(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, _too_large(body))
        return message

    return receive_bounded
