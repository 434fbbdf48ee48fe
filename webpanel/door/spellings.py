"""Other ways to spell a call: HEAD wherever GET is, and `/api/v1/…` for `/api/…`."""

from collections.abc import Iterable
from re import Pattern
from typing import Final

import anyio
from starlette.types import ASGIApp, Message, Receive, Scope, Send

#: The version of the API that its addresses may name. Without one, they mean the newest version.
VERSION: Final = "/api/v1"
#: What the panel answers itself; the page's files answer HEAD as they are.
_ANSWERED: Final = ("/api/", "/metrics", "/healthz", "/docs", "/openapi.json")


class Spellings:
    """ASGI middleware: passes a call on as its routes know it.

    Args:
        app: knows `GET /api/…`.
        heads: the paths whose routes answer HEAD themselves.
    """

    def __init__(self, app: ASGIApp, heads: Iterable[Pattern[str]]) -> None:
        self._app = app
        self._heads = tuple(heads)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """One request."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        if scope["path"].startswith(f"{VERSION}/"):
            scope = {**scope, "path": "/api" + scope["path"].removeprefix(VERSION)}
        path = scope["path"]
        asked = scope["method"] == "HEAD" and path.startswith(_ANSWERED)
        if not asked or any(pattern.match(path) for pattern in self._heads):
            await self._app(scope, receive, send)
            return
        with anyio.CancelScope() as answering:

            async def send_head(message: Message) -> None:
                if message["type"] == "http.response.start":
                    await send(message)
                elif not answering.cancel_called:
                    await send({"type": "http.response.body", "body": b"", "more_body": False})
                    answering.cancel()  # a stream has no end

            await self._app({**scope, "method": "GET"}, receive, send_head)
