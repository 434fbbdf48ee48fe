"""Refusals and failures as problem details (RFC 9457), also those of the web framework; headers of every answer."""

import re
from collections.abc import Iterable, Mapping
from http import HTTPStatus
from typing import Final

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from fastapi.routing import APIRoute
from pydantic import BaseModel, Field
from starlette.exceptions import HTTPException

from rig.api.fields import Model
from rig.errors import (
    BadInputError,
    StateForbidsError,
    StorageError,
    SvevError,
    UnknownAlarmError,
    UnknownCameraError,
    UnknownExportError,
    UnknownLineError,
    UnknownRecordingError,
)
from rig.phrase import Phrase

_PAGE_POLICY: Final = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; media-src 'self'; "
    "connect-src 'self'; font-src 'self'; manifest-src 'self'; form-action 'self'; base-uri 'none'; "
    "frame-ancestors 'none'"
)
#: What every answer forbids the browser to do, unless the answer sets the header itself.
SECURITY_HEADERS: Final = {
    "content-security-policy": _PAGE_POLICY,
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "permissions-policy": "camera=(), microphone=(self), geolocation=()",
}
#: Headers of an answer that does not pass through the guard, and behind which the server closes the connection.
CLOSING: Final = {**SECURITY_HEADERS, "Connection": "close"}
MEDIA_TYPE = "application/problem+json"
#: The status of an error of ours: that of the first class in the table that it belongs to.
_STATUSES: tuple[tuple[type[SvevError], HTTPStatus], ...] = (
    (UnknownRecordingError, HTTPStatus.NOT_FOUND),
    (UnknownExportError, HTTPStatus.NOT_FOUND),
    (UnknownCameraError, HTTPStatus.NOT_FOUND),
    (UnknownAlarmError, HTTPStatus.NOT_FOUND),
    (UnknownLineError, HTTPStatus.NOT_FOUND),
    (StateForbidsError, HTTPStatus.CONFLICT),
    (BadInputError, HTTPStatus.UNPROCESSABLE_ENTITY),
    (StorageError, HTTPStatus.INSUFFICIENT_STORAGE),
    (SvevError, HTTPStatus.SERVICE_UNAVAILABLE),
)
#: The advice for errors that the framework raises.
_ADVICE = {
    HTTPStatus.NOT_FOUND: "there is nothing at this address; see /docs",
    HTTPStatus.METHOD_NOT_ALLOWED: "this address does not take this method; see the Allow header",
}


class FieldError(Model):
    """One thing that is wrong in a request."""

    where: str = Field(examples=["body.duration_s"])
    text: str = Field(examples=["Input should be greater than or equal to 0"])


class Problem(BaseModel):
    """Problem details (RFC 9457); `code` is stable, `detail` says what to do."""

    type: str = "about:blank"
    title: str
    status: int
    detail: str
    instance: str = ""
    code: str
    said: Phrase | None = Field(None, description="`detail` with a code of its own, where it has one")
    errors: tuple[FieldError, ...] = Field((), description="with status 422: what is wrong, one by one")


class ProblemError(Exception):
    """A refusal by the panel itself; it becomes an answer and never leaves the panel."""

    def __init__(self, status: HTTPStatus, code: str, detail: str, headers: Mapping[str, str] | None = None) -> None:
        super().__init__(detail)
        self._arguments = status, code, detail, headers

    def answer(self) -> JSONResponse:
        """The refusal as an answer."""
        return problem(*self._arguments)


def problem(
    status: HTTPStatus,
    code: str,
    detail: str,
    headers: Mapping[str, str] | None = None,
    errors: tuple[FieldError, ...] = (),
    said: Phrase | None = None,
) -> JSONResponse:
    """The answer to a request that is refused or failed; `detail` says what to do."""
    told = said if said is not None and said.code else None
    body = Problem(title=status.phrase, status=status, detail=detail, code=code, said=told, errors=errors)
    return JSONResponse(
        body.model_dump(mode="json", exclude_defaults=True) | {"type": body.type}, status, headers, MEDIA_TYPE
    )


def handle_errors(app: FastAPI, routes: Iterable[APIRoute]) -> None:
    """Answer all errors of an application with problems.

    Args:
        app: the application.
        routes: all routes, to tell a client that uses a wrong method which methods are right.
    """
    table = list(routes)

    @app.exception_handler(ProblemError)
    async def _panel(_: Request, error: ProblemError) -> JSONResponse:
        return error.answer()

    @app.exception_handler(SvevError)
    async def _svev(_: Request, error: SvevError) -> JSONResponse:
        status = next(status for kind, status in _STATUSES if isinstance(error, kind))
        return problem(status, code_of(error), str(error), said=error.said)

    @app.exception_handler(HTTPException)
    async def _framework(request: Request, error: HTTPException) -> JSONResponse:
        status = HTTPStatus(error.status_code)
        if status is HTTPStatus.BAD_REQUEST:  # no JSON parser can read it, e.g. broken UTF-8
            return problem(HTTPStatus.UNPROCESSABLE_ENTITY, "invalid_request", "the body is no JSON: correct it")
        headers = dict(error.headers or {})
        if status is HTTPStatus.METHOD_NOT_ALLOWED:
            methods = [route.methods or set() for route in table if route.path_regex.match(request.url.path)]
            allowed = set[str]().union(*methods)
            allowed |= {"HEAD"} if "GET" in allowed else set()
            headers["Allow"] = ", ".join(sorted(allowed)) or headers.get("Allow", "GET, HEAD")
        return problem(status, status.name.lower(), _ADVICE.get(status, error.detail), headers)

    @app.exception_handler(RequestValidationError)
    async def _fields(_: Request, error: RequestValidationError) -> JSONResponse:
        errors = tuple(FieldError(where=_where(entry["loc"]), text=str(entry["msg"])) for entry in error.errors())
        detail = "; ".join(f"{each.where}: {each.text}" for each in errors[:5])
        return problem(HTTPStatus.UNPROCESSABLE_ENTITY, "invalid_request", f"correct {detail}", errors=errors[:50])

    @app.exception_handler(Exception)
    async def _unforeseen(_: Request, error: Exception) -> JSONResponse:
        detail = (
            f"an error in svev itself ({type(error).__name__}): try again; what happened stands in the service's log"
        )
        return problem(HTTPStatus.INTERNAL_SERVER_ERROR, "internal_error", detail, CLOSING)


def code_of(error: SvevError) -> str:
    """The stable name of an error, from the name of its class: e.g. `state_forbids`."""
    return re.sub(r"(?<!^)(?=[A-Z])", "_", type(error).__name__.removesuffix("Error")).lower()


def _where(location: tuple[int | str, ...]) -> str:
    return ".".join(str(part) for part in location)[:100]
