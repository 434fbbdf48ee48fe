"""The documentation of the API at `/docs`: Swagger UI, served from this computer, for a hill without internet."""

from importlib.resources import files
from typing import Any, Final

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi
from fastapi.responses import Response

from rig.api.status import Event
from webpanel.door.access import Access
from webpanel.door.guard import OPEN, PROTECTED
from webpanel.door.logins import COOKIE
from webpanel.door.roles import needed_role
from webpanel.problems import Problem

DESCRIPTION: Final = """
Operates the three-camera rig and its recordings. Times are UTC. Unknown fields and parameters are refused.

`/api/v1/…` is the same as `/api/…`: programs that name the version go on working if a later one changes. Every path
that takes GET takes HEAD.

With tokens, each call needs a role, which stands with its security: `watch`, `operate` (which may watch too) or
`administer` (which may do everything).

The page may use a microphone, keep the display on and be installed over HTTPS only (or on this computer itself):
`svev certificate --name NAME --out FOLDER` makes a certificate, `svev serve --tls-certificate FILE --tls-key FILE`
uses it, and `docs/how-to/hill-pc.md` says how phones come to trust it.

Every error is a problem (RFC 9457, `application/problem+json`): `code` is stable, `detail` says what to do.
"""
_TAGS: Final = {
    "Rig": "The rig as a whole: its state, arming, the rig file, the doctor, rehearsals.",
    "Recordings": "Starting and stopping, and what was recorded: list, session fields, pictures, files, the trash.",
    "Jumpers": "The start list and the next jumper, whom every recording takes at its start.",
    "Calibration": "Pictures of a printed target, and the calibration of the cameras that comes of them.",
    "Exports": "Videos, pictures and tables of recordings, made by the service beside its work.",
    "Athletes": "The measured jumps of all recordings, by athlete and day.",
    "Measurements": "What was measured in a recording, by itself after its end: figures, files, progress.",
    "Measuring by hand": "Marks of people in the images of a recording, and what follows from them in space.",
    "Watching": "What happens now: events and live pictures.",
    "Login": "Tokens, cookies, links to single recordings, and what one may do.",
    "Observing": "For monitoring programs.",
}
#: Swagger UI draws its icons as data: images and sets styles from scripts.
_POLICY: Final = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; "
    "connect-src 'self'; base-uri 'none'; frame-ancestors 'none'"
)
_ASSETS: Final = {
    "/docs": ("webpanel", "docs_page/index.html", "text/html; charset=utf-8"),
    "/docs/icon.svg": ("webpanel", "page/icon.svg", "image/svg+xml"),
    "/docs/start.js": ("webpanel", "docs_page/start.js", "text/javascript; charset=utf-8"),
    "/docs/swagger-ui.css": ("fastapi_offline", "static/swagger-ui.css", "text/css; charset=utf-8"),
    "/docs/swagger-ui-bundle.js": (
        "fastapi_offline", "static/swagger-ui-bundle.js", "text/javascript; charset=utf-8",
    ),
}  # fmt: skip


def serve_documentation(app: FastAPI, access: Access) -> None:
    """Add the pages, and complete the schema."""
    for path, (package, name, media_type) in _ASSETS.items():
        app.get(path, include_in_schema=False)(_asset(package, name, media_type))

    def schema() -> dict[str, Any]:
        if app.openapi_schema is None:
            app.openapi_schema = _schema(app, access)
        return app.openapi_schema

    app.openapi = schema  # type: ignore[method-assign] # FastAPI's documented way to extend the schema


def _asset(package: str, name: str, media_type: str) -> Any:
    def read() -> Response:
        content = files(package).joinpath(name).read_bytes()
        return Response(content, media_type=media_type, headers={"Content-Security-Policy": _POLICY})

    return read


def _schema(app: FastAPI, access: Access) -> dict[str, Any]:
    schema = get_openapi(
        title=app.title, version=app.version, description=app.description, routes=app.routes,
        tags=[{"name": name, "description": text} for name, text in _TAGS.items()],
        servers=[{"url": "/", "description": "The service that serves this page."}],
    )  # fmt: skip
    components = schema.setdefault("components", {})
    for model in (Problem, Event):  # no route returns these by themselves
        described = model.model_json_schema(ref_template="#/components/schemas/{model}")
        components["schemas"] |= described.pop("$defs", {}) | {model.__name__: described}
    components["securitySchemes"] = {
        "token": {"type": "http", "scheme": "bearer", "description": "A token of the service's token file."},
        "session": {
            "type": "apiKey", "in": "cookie", "name": COOKIE, "description": "The cookie of `POST /api/login`.",
        },
    }  # fmt: skip
    for methods in schema["paths"].values():
        for operation in methods.values():
            _describe_streams(operation)
    if access.tokens:
        schema["security"] = [{"token": []}, {"session": []}]
        for path, methods in schema["paths"].items():
            for method, operation in methods.items():
                role = needed_role(method.upper(), path)
                needs_token = path.startswith(PROTECTED) and path not in OPEN
                operation["security"] = [{"token": [role]}, {"session": [role]}] if needs_token else []
    return schema


def _describe_streams(operation: dict[str, Any]) -> None:
    """Say of server-sent events what OpenAPI 3.1 has words for: FastAPI describes each of them, as 3.2 does."""
    for response in operation["responses"].values():
        for media in response.get("content", {}).values():
            if media.pop("itemSchema", None) is not None:
                media["schema"] = {
                    "type": "string",
                    "description": "server-sent events; the data of each is an `Event`",
                }
