"""The documentation of the API at `/docs`: Swagger UI, served from this computer, for a hill without internet."""

from importlib.resources import files
from typing import Any, Final

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi
from fastapi.responses import Response

from rig.status import Event
from webpanel.door.access import Access
from webpanel.problems import Problem

DESCRIPTION: Final = """
Operates the three-camera rig and its recordings. Times are UTC. Unknown fields and parameters are refused.

Every error is a problem (RFC 9457, `application/problem+json`): `code` is stable, `detail` says what to do.
"""
#: Swagger UI draws its icons as data: images and sets styles from scripts.
_POLICY: Final = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; "
    "connect-src 'self'; base-uri 'none'; frame-ancestors 'none'"
)
_ASSETS: Final = {
    "/docs": ("webpanel", "docs_page/index.html", "text/html; charset=utf-8"),
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
    schema = get_openapi(title=app.title, version=app.version, description=app.description, routes=app.routes)
    components = schema.setdefault("components", {})
    for model in (Problem, Event):  # no route returns these by themselves
        described = model.model_json_schema(ref_template="#/components/schemas/{model}")
        components["schemas"] |= described.pop("$defs", {}) | {model.__name__: described}
    if access.tokens:
        components["securitySchemes"] = {"token": {"type": "http", "scheme": "bearer"}}
        schema["security"] = [{"token": []}]
        schema["paths"]["/api/login"]["post"]["security"] = []
    return schema
