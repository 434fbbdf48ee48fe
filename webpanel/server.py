"""The HTTP server of the panel: uvicorn, with limits on time and number of connections."""

import asyncio
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from http import HTTPStatus
from typing import Any, Final

import h11
import uvicorn
from fastapi import FastAPI
from uvicorn.protocols.http.h11_impl import H11Protocol

from webpanel.door.guard import HEAD_MAX
from webpanel.door.tls import Tls
from webpanel.problems import CLOSING, problem

#: A request, headers and body, must be complete within this time of its first byte (or of the connection).
REQUEST_S: Final = 10.0
#: A client that takes nothing of an answer for this time is disconnected.
STALL_S: Final = 20.0
#: More than there are streams, waits and downloads at most (`webpanel.door.streams`): commands always find room.
CONNECTIONS_MAX: Final = 256
_GRACE_S = 3  # for answers under way at shutdown


class PanelServer(uvicorn.Server):
    """Ends the endless answers (event streams, previews) at shutdown instead of waiting for them."""

    def __init__(self, config: uvicorn.Config, app: FastAPI) -> None:
        super().__init__(config)
        self._app = app

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Leave signals to the program around the server."""
        yield

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """End streams, then connections."""
        self._app.state.streams.end()
        await super().shutdown(sockets)


def make_server(app: FastAPI, tls: Tls | None = None) -> PanelServer:
    """Make a server for the panel; run it with bound sockets: `server.run(sockets=[...])`.

    With a certificate it speaks HTTPS, and HTTPS only.

    It writes no access log: addresses may hold what nobody should read later. /metrics counts requests.
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
        ssl_certfile=tls.certificate if tls else None,
        ssl_keyfile=tls.key if tls else None,
        h11_max_incomplete_event_size=HEAD_MAX,
        timeout_graceful_shutdown=_GRACE_S,
    )
    return PanelServer(config, app)


class GuardedConnection(H11Protocol):
    """One HTTP/1.1 connection of uvicorn, with a timeout on every wait for the client.

    When there are too many connections, the one that has been idle for longest is closed; if none is idle, the new
    one is (decision 0012).
    """

    request_s = REQUEST_S
    stall_s = STALL_S
    connections_max = CONNECTIONS_MAX

    def __init__(self, *arguments: Any, **more: Any) -> None:
        super().__init__(*arguments, **more)
        self.access_log = False
        self._deadline: asyncio.TimerHandle | None = None
        self._stalled: asyncio.TimerHandle | None = None
        self._last_heard = 0.0

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """A client has connected."""
        super().connection_made(transport)
        # asyncio sets this itself only on sockets that were created with the number of TCP, which ours are not.
        transport.get_extra_info("socket").setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._last_heard = self.loop.time()
        self._watch()
        if len(self.connections) > self.connections_max:
            self._make_room()

    def connection_lost(self, exc: Exception | None) -> None:
        """The client has disconnected."""
        for timer in (self._deadline, self._stalled):
            if timer is not None:
                timer.cancel()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Bytes of a request have come. They do not restart its timer: a client could send one byte at a time."""
        self._last_heard = self.loop.time()
        super().data_received(data)
        self._watch()

    def pause_writing(self) -> None:
        """The client takes less than it is sent: start its timer."""
        super().pause_writing()
        if self._stalled is None:
            self._stalled = self.loop.call_later(self.stall_s, self.transport.abort)

    def resume_writing(self) -> None:
        """The client has caught up: stop its timer."""
        super().resume_writing()
        if self._stalled is not None:
            self._stalled.cancel()
            self._stalled = None

    def send_400_response(self, msg: str) -> None:
        """Answer what is not HTTP with a problem, as every refusal."""
        self._refuse(HTTPStatus.BAD_REQUEST, "bad_request", msg)

    @property
    def _idle(self) -> bool:
        return self.cycle is None or self.cycle.response_complete

    def _watch(self) -> None:
        """Run the timer of the request exactly while one is incomplete."""
        waiting = self.conn.their_state in {h11.IDLE, h11.SEND_BODY}
        if waiting and self._deadline is None:
            self._deadline = self.loop.call_later(self.request_s, self._too_slow)
        elif not waiting and self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None

    def _too_slow(self) -> None:
        if self._idle or not self.cycle.response_started:
            text = f"the request was not complete within {self.request_s:g} s: send it faster"
            self._refuse(HTTPStatus.REQUEST_TIMEOUT, "request_timeout", text)
        self.transport.close()

    def _refuse(self, status: HTTPStatus, code: str, detail: str) -> None:
        if self.conn.our_state not in {h11.IDLE, h11.SEND_RESPONSE} or self.transport.is_closing():
            self.transport.close()
            return
        answer = problem(status, code, detail, CLOSING)
        head = h11.Response(status_code=status, headers=answer.raw_headers, reason=status.phrase)
        for event in (head, h11.Data(data=bytes(answer.body)), h11.EndOfMessage()):
            self.transport.write(self.conn.send(event) or b"")
        self.transport.close()

    def _make_room(self) -> None:
        idle = [each for each in self.connections if isinstance(each, GuardedConnection) and each._idle]
        oldest = min(idle, key=lambda each: each._last_heard, default=self)
        self.connections.discard(oldest)
        oldest.transport.abort()
