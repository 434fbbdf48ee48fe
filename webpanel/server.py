"""uvicorn with the limits of this panel."""

import socket
from collections.abc import Iterator
from contextlib import contextmanager

import uvicorn
from fastapi import FastAPI

from webpanel.connection import GuardedConnection
from webpanel.guard import HEAD_MAX

_GRACE_S = 3


class PanelServer(uvicorn.Server):
    """Ends the endless answers when it shuts down, so that it need not wait for them."""

    def __init__(self, config: uvicorn.Config, app: FastAPI) -> None:
        super().__init__(config)
        self._app = app

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Leave signals to the program around it."""
        yield

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """End."""
        self._app.state.streams.end()
        await super().shutdown(sockets)


def make_server(app: FastAPI) -> PanelServer:
    """A server for the panel; run it with sockets that are bound already: `server.run(sockets=[...])`.

    It writes no access log: requests are counted at /metrics, and what was in an address stays out of the logs.
    """
    config = uvicorn.Config(
        app,
        http=GuardedConnection,
        ws="none",
        lifespan="on",
        log_config=None,
        access_log=False,
        server_header=False,
        proxy_headers=False,
        h11_max_incomplete_event_size=HEAD_MAX,
        timeout_graceful_shutdown=_GRACE_S,
    )
    return PanelServer(config, app)
