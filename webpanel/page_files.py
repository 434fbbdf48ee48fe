"""The files of the page, from memory: packed, and at addresses that name their version, so that browsers keep them."""

import gzip
import hashlib
import re
from functools import cache
from http import HTTPStatus
from importlib.resources import files
from pathlib import Path, PurePosixPath
from typing import Final

from fastapi import FastAPI
from fastapi.responses import Response
from starlette.datastructures import Headers
from starlette.types import ASGIApp, Receive, Scope, Send

from webpanel.problems import problem

_TYPES: Final = {
    ".html": "text/html; charset=utf-8", ".js": "text/javascript; charset=utf-8", ".css": "text/css; charset=utf-8",
    ".svg": "image/svg+xml",
}  # fmt: skip
_DOCUMENT: Final = ".html"
_METHODS: Final = ("GET", "HEAD")
#: Begins the path of a file that a document names.
_NAMED: Final = re.compile(rb'(?<==")\./(?=[\w/-]+\.(?:js|css|svg)["#])')
_VERSION_LENGTH: Final = 16
#: What stands at an address with a version never changes there.
_KEPT: Final = "public, max-age=31536000, immutable"


class Page:
    """The page as its files were when it was read: an update of the package while it is served does not mix versions.

    Documents stand at `/NAME.html`, all other files at `/page/VERSION/…`, where VERSION is made of the content of all;
    the documents name them there, and modules find each other from where they stand.

    Args:
        folder: holds the files.

    Attributes:
        version: of all files together.
    """

    def __init__(self, folder: Path) -> None:
        contents = {
            path.relative_to(folder).as_posix(): path.read_bytes()
            for path in sorted(folder.rglob("*"))
            if path.suffix in _TYPES
        }
        digest = hashlib.sha256()
        for name, content in contents.items():
            digest.update(f"{name} {len(content)} ".encode() + content)
        self.version = digest.hexdigest()[:_VERSION_LENGTH]
        self._files: dict[str, bytes] = {}
        self._packed: dict[str, bytes] = {}
        place = f"/page/{self.version}/"
        for name, content in contents.items():
            if name.endswith(_DOCUMENT):
                self._files[f"/{name}"] = _NAMED.sub(f".{place}".encode(), content)
            else:
                self._files[place + name] = content

    def __contains__(self, path: str) -> bool:
        """Whether a file stands at this path."""
        return path in self._files

    def answer(self, path: str, headers: Headers) -> Response:
        """A file, or that the browser has it already.

        Args:
            path: that a file stands at.
            headers: of the request.
        """
        told = {"Vary": "Accept-Encoding"}
        if path.endswith(_DOCUMENT):  # asked for each time: it names the version of all others
            told["ETag"] = f'"{self.version}"'
            if told["ETag"] in headers.get("if-none-match", ""):
                return Response(status_code=HTTPStatus.NOT_MODIFIED, headers=told)
        else:
            told["Cache-Control"] = _KEPT
        content = self._files[path]
        if "gzip" in headers.get("accept-encoding", ""):
            told["Content-Encoding"] = "gzip"
            content = self._pack(path)
        return Response(content, headers=told, media_type=_TYPES[PurePosixPath(path).suffix])

    def _pack(self, path: str) -> bytes:
        if path not in self._packed:
            self._packed[path] = gzip.compress(self._files[path], mtime=0)
        return self._packed[path]


@cache
def _own_page() -> Page:
    return Page(Path(str(files("webpanel") / "page")))


class PageFiles:
    """ASGI middleware: answers requests for files of the page.

    Args:
        app: answers all others.
        root: path of the document that stands at `/`; None: that path is the application's.
    """

    def __init__(self, app: ASGIApp, root: str | None) -> None:
        self._app = app
        self._root = root

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """One request."""
        path = scope["path"] if scope["type"] == "http" else ""
        if path == "/" and self._root is not None:
            path = self._root
        page = _own_page()
        if path not in page:
            await self._app(scope, receive, send)
        elif scope["method"] not in _METHODS:
            text = "this address does not take this method; see the Allow header"
            allowed = {"Allow": ", ".join(_METHODS)}
            refusal = problem(HTTPStatus.METHOD_NOT_ALLOWED, "method_not_allowed", text, allowed)
            await refusal(scope, receive, send)
        else:
            await page.answer(path, Headers(scope=scope))(scope, receive, send)


def serve_page(app: FastAPI, root: str | None = None) -> None:
    """Serve the files of the page. What is added to the application later stands around it.

    Args:
        app: the application.
        root: path of the document that stands at `/`; None: that path is the application's.
    """
    app.add_middleware(PageFiles, root=root)
