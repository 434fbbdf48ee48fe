"""Every refusal and failure as problem details (RFC 9457), also what the web framework refuses by itself."""

import re
from collections.abc import Iterable, Mapping
from http import HTTPStatus

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from fastapi.routing import APIRoute
from starlette.exceptions import HTTPException

from recorder.catalogue import UnknownRecordingError
from rig.errors import BadInputError, StorageError, SvevError
from webpanel.models import FieldError, Problem
from webpanel.rig_service import StateForbidsError
from webpanel.security_headers import SECURITY_HEADERS

MEDIA_TYPE = "application/problem+json"
#: The statuses of our own errors; the first class that fits.
_STATUSES: tuple[tuple[type[SvevError], HTTPStatus], ...] = (
    (UnknownRecordingError, HTTPStatus.NOT_FOUND),
    (StateForbidsError, HTTPStatus.CONFLICT),
    (BadInputError, HTTPStatus.UNPROCESSABLE_ENTITY),
    (StorageError, HTTPStatus.INSUFFICIENT_STORAGE),
    (SvevError, HTTPStatus.SERVICE_UNAVAILABLE),
)
#: What to do about the errors that the framework raises.
_ADVICE = {
    HTTPStatus.NOT_FOUND: "there is nothing at this address; see /docs",
    HTTPStatus.METHOD_NOT_ALLOWED: "this address does not take this method; see the Allow header",
}


class ProblemError(Exception):
    """A refusal that is made in the panel itself; handled here, never seen outside."""

    def __init__(self, status: HTTPStatus, code: str, detail: str, headers: Mapping[str, str] | None = None) -> None:
        super().__init__(detail)
        self.status = status
        self.code = code
        self.detail = detail
        self.headers = headers


def problem(
    status: HTTPStatus,
    code: str,
    detail: str,
    headers: Mapping[str, str] | None = None,
    errors: tuple[FieldError, ...] = (),
) -> JSONResponse:
    """The answer that says no: what is wrong, and in `detail` what to do."""
    body = Problem(title=status.phrase, status=status, detail=detail, code=code, errors=errors)
    return JSONResponse(
        body.model_dump(mode="json", exclude_defaults=True) | {"type": body.type}, status, headers, MEDIA_TYPE
    )


def handle_errors(app: FastAPI, routes: Iterable[APIRoute]) -> None:
    """Have all errors of an application answered as problems.

    Args:
        app: the application.
        routes: all that there are, so that who uses a wrong method is told all right ones.
    """
    table = list(routes)
    # The answer to an unforeseen error passes no middleware, and the server closes the connection behind it.
    closing = {**SECURITY_HEADERS, "Connection": "close"}

    @app.exception_handler(ProblemError)
    async def _panel(_: Request, error: ProblemError) -> JSONResponse:
        return problem(error.status, error.code, error.detail, error.headers)

    @app.exception_handler(SvevError)
    async def _svev(_: Request, error: SvevError) -> JSONResponse:
        status = next(status for kind, status in _STATUSES if isinstance(error, kind))
        return problem(status, code_of(error), str(error))

    @app.exception_handler(HTTPException)
    async def _framework(request: Request, error: HTTPException) -> JSONResponse:
        status = HTTPStatus(error.status_code)
        if status is HTTPStatus.BAD_REQUEST:  # text that no JSON parser can do anything with
            return problem(HTTPStatus.UNPROCESSABLE_ENTITY, "invalid_request", "the body is no JSON: correct it")
        headers = dict(error.headers or {})
        if status is HTTPStatus.METHOD_NOT_ALLOWED:
            methods = [route.methods or set() for route in table if route.path_regex.match(request.url.path)]
            headers["Allow"] = ", ".join(sorted(set[str]().union(*methods))) or headers.get("Allow", "GET, HEAD")
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
        return problem(HTTPStatus.INTERNAL_SERVER_ERROR, "internal_error", detail, closing)


def code_of(error: SvevError) -> str:
    """The stable name of an error: its class, e.g. `state_forbids`."""
    return re.sub(r"(?<!^)(?=[A-Z])", "_", type(error).__name__.removesuffix("Error")).lower()


def _where(location: tuple[int | str, ...]) -> str:
    return ".".join(str(part) for part in location)[:100]
