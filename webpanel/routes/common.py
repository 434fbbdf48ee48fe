"""What all routes share: routers that refuse unknown parameters, the documentation of refusals, common parameters."""

import re
from collections.abc import Callable, Coroutine, Iterable
from http import HTTPStatus
from typing import Annotated, Any, Final

from fastapi import APIRouter, Body, FastAPI, Path, Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.routing import APIRoute
from isal import igzip as gzip
from pydantic import AwareDatetime, BeforeValidator
from starlette.routing import compile_path

from rig.api.fields import Model
from rig.host.file_names import ID_PATTERN
from webpanel.problems import MEDIA_TYPE

_DATE: Final = re.compile(r"\d{4}-\d\d-\d\d[Tt ]")
#: A long list repeats itself so much that compressing it thoroughly wins nothing.
_LIGHTLY: Final = 1


#: A page of a result runs as if it came from nowhere: it reaches nothing of the panel.
ALONE: Final = {
    "Content-Security-Policy": "sandbox allow-scripts allow-popups allow-downloads",
    "X-Content-Type-Options": "nosniff",
    "Cache-Control": "no-cache",
}


class Nothing(Model):
    """A body without fields."""


def _written_out(text: object) -> object:
    """Let no bare number pass for a time.

    Raises:
        ValueError: the text does not begin with a date.
    """
    if isinstance(text, str) and not _DATE.match(text):
        raise ValueError("give date, time and zone, e.g. 2026-11-20T10:00:00Z")
    return text


Moment = Annotated[AwareDatetime, BeforeValidator(_written_out)]


RecordingId = Annotated[
    str,
    Path(pattern=f"^{ID_PATTERN}$", description="id of a recording, percent-encoded", examples=["20260214-101530"]),
]
NoFields = Annotated[Nothing | None, Body(description="nothing, or an empty object")]

Responses = dict[int | str, dict[str, Any]]

#: For the documentation: what each status means in this API, with an example of code and detail.
_MEANINGS: Final[dict[int, tuple[str, str, str]]] = {
    400: ("The request cannot be read, or calls the service by an unknown name.", "unknown_host",
          "the service is not called by this name: use its address, or start it with --allow-host NAME"),
    401: ("The token is missing or wrong.", "login_required",
          "this needs the token: log in on the page, or send it as Authorization: Bearer TOKEN"),
    403: ("The token's role does not allow it, or the request comes from a page of another site.", "foreign_origin",
          "the request comes from a page of another site: use the page of this service"),
    404: ("There is no such thing: recording, pulse, picture.", "unknown_recording",
          "no recording 'jump-7': see the list of recordings"),
    409: ("The state forbids it; `detail` says what to do instead.", "state_forbids", "the rig is idle: arm it first"),
    413: ("The body is too large.", "request_entity_too_large",
          "the request's body is too large: no call needs more than 64 KiB"),
    415: ("The body is not JSON.", "unsupported_media_type",
          "the body must be JSON: send Content-Type: application/json"),
    416: ("The file ends before the range that was asked for.", "range_not_satisfiable",
          "the file has 1048576 bytes: ask for a range within it"),
    422: ("A field or parameter is unknown or malformed; `errors` lists them.", "invalid_request",
          "correct body.bib: String should have at most 200 characters"),
    429: ("Too many wrong tokens.", "too_many_wrong_tokens",
          "too many wrong tokens from here: wait 42 s, then try again"),
    500: ("An error in svev itself.", "internal_error", "an error in svev itself (KeyError): try again"),
    503: ("It cannot be done now; `detail` says why.", "too_many_viewers",
          "64 are connected already, which is the most: close some, or try again later"),
    507: ("The disk is full or refuses.", "storage", "less than 2 GB are free: delete recordings"),
}  # fmt: skip


def refusals(*statuses: int) -> Responses:
    """Document that a route may answer with these problems."""
    return {status: _declare(status) for status in statuses}


def compressed(request: Request, body: bytes, headers: dict[str, str] | None = None) -> Response:
    """Answer with a long list in JSON, compressed if the client understands that."""
    headers = {"Vary": "Accept-Encoding"} | (headers or {})
    if "gzip" in request.headers.get("accept-encoding", ""):
        body, headers["Content-Encoding"] = gzip.compress(body, _LIGHTLY), "gzip"
    return Response(body, media_type="application/json", headers=headers)


def jpeg_answer(description: str) -> Responses:
    """Document that a route answers with an image."""
    content = {"image/jpeg": {"schema": {"type": "string", "format": "binary"}}}
    return {200: {"description": description, "content": content}}


def _declare(status: int) -> dict[str, Any]:
    meaning, code, detail = _MEANINGS[status]
    example = {
        "type": "about:blank", "title": HTTPStatus(status).phrase, "status": status, "detail": detail, "code": code,
    }  # fmt: skip
    schema = {"$ref": "#/components/schemas/Problem"}
    return {"description": meaning, "content": {MEDIA_TYPE: {"schema": schema, "example": example}}}


#: Problems that every route may answer with.
COMMON: Final = refusals(400, 401, 403, 422, 429, 500)
#: Further problems that a route which changes something may answer with.
CHANGING: Final = refusals(409, 413, 415, 503, 507)


class StrictRoute(APIRoute):
    """A route that answers 422 to unknown and to repeated query parameters.

    What the framework makes of the types of its parameters and of its answer takes a millisecond, and the panel has a
    hundred routes: it is made when the first request meets the route, or when somebody asks for its description.
    """

    def __init__(self, path: str, endpoint: Callable[..., Any], **more: Any) -> None:
        self._unmade = (path, endpoint, more)
        self.path, self.endpoint = path, endpoint
        self.methods = set(more["methods"])
        self.path_regex, self.path_format, self.param_convertors = compile_path(path)

    def again(self) -> "StrictRoute":
        """Another such route, not made yet; of one that was not made."""
        path, endpoint, more = self._unmade
        return StrictRoute(path, endpoint, **more)

    def __getattr__(self, name: str) -> Any:
        """Make the rest of the route, of which `name` is a part."""
        unmade = self.__dict__.pop("_unmade", None)
        if unmade is None:
            raise AttributeError(f"a route has no {name}")
        path, endpoint, more = unmade
        super().__init__(path, endpoint, **more)
        return getattr(self, name)

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Put the check in front of the framework's handler."""
        handler = super().get_route_handler()
        dependants = (self.dependant, *self.dependant.dependencies)
        known = {parameter.alias for each in dependants for parameter in each.query_params}

        async def checked(request: Request) -> Response:
            names = [name for name, _ in request.query_params.multi_items()]
            wrong = [(name, "Unknown parameter") for name in names if name not in known]
            wrong += [(name, "Parameter given twice") for name in known if names.count(name) > 1]
            if wrong:
                raise RequestValidationError(
                    [{"type": "query", "loc": ("query", name), "msg": text} for name, text in wrong]
                )
            return await handler(request)

        return checked


def strict_router(tag: str, prefix: str = "/api") -> APIRouter:
    """Make a router of strict routes below `prefix`; `tag` is their chapter of the documentation."""
    return APIRouter(
        prefix=prefix,
        tags=[tag],
        route_class=StrictRoute,
        responses=COMMON,
        generate_unique_id_function=lambda route: route.name,
    )


def add_routers(app: FastAPI, routers: Iterable[APIRouter]) -> list[APIRoute]:
    """Give an application routes of its own like those of routers, whose paths are complete.

    `app.include_router` would make each of them at once.

    Returns:
        The routes.
    """
    routes: list[APIRoute] = [
        route.again() for router in routers for route in router.routes if isinstance(route, StrictRoute)
    ]
    app.router.routes.extend(routes)
    return routes
