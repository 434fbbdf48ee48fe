"""HTTP/1.1 connections that cannot be held open by doing nothing, slowly."""

import asyncio
import json
import socket
from typing import Any, Final

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

from webpanel.problems import MEDIA_TYPE
from webpanel.security_headers import SECURITY_HEADERS

#: A request, headers and body, must be there so soon after its first byte (or the connection).
REQUEST_S: Final = 10.0
#: A client that takes nothing of an answer for so long is gone.
STALL_S: Final = 20.0
CONNECTIONS_MAX: Final = 128


class GuardedConnection(H11Protocol):
    """uvicorn's connection, with an end to every wait, and an end to their number.

    When there are too many, the one that has been idle for longest is closed; if none is idle, the new one is.
    """

    request_s = REQUEST_S
    stall_s = STALL_S
    connections_max = CONNECTIONS_MAX

    def __init__(self, *arguments: Any, **more: Any) -> None:
        super().__init__(*arguments, **more)
        self.access_log = False  # addresses may hold what nobody should read later
        self._deadline: asyncio.TimerHandle | None = None
        self._stalled: asyncio.TimerHandle | None = None
        self._last_heard = 0.0

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """A client has come."""
        super().connection_made(transport)
        # asyncio does this by itself only for sockets that were made with the protocol's number.
        transport.get_extra_info("socket").setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._last_heard = self.loop.time()
        self._watch()
        if len(self.connections) > self.connections_max:
            self._make_room()

    def connection_lost(self, exc: Exception | None) -> None:
        """The client has gone."""
        for timer in (self._deadline, self._stalled):
            if timer is not None:
                timer.cancel()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Bytes of a request; the time that it may take does not begin anew with them."""
        self._last_heard = self.loop.time()
        super().data_received(data)
        self._watch()

    def pause_writing(self) -> None:
        """The client takes less than it is sent."""
        super().pause_writing()
        if self._stalled is None:
            self._stalled = self.loop.call_later(self.stall_s, self.transport.abort)

    def resume_writing(self) -> None:
        """The client has taken most of it."""
        super().resume_writing()
        if self._stalled is not None:
            self._stalled.cancel()
            self._stalled = None

    def send_400_response(self, msg: str) -> None:
        """Refuse what is no HTTP, as a problem like all others."""
        self._refuse(400, "bad_request", msg)

    @property
    def _idle(self) -> bool:
        return self.cycle is None or self.cycle.response_complete

    def _watch(self) -> None:
        """Run the timer while a request is under way."""
        waiting = self.conn.their_state in {h11.IDLE, h11.SEND_BODY}
        if waiting and self._deadline is None:
            self._deadline = self.loop.call_later(self.request_s, self._too_slow)
        elif not waiting and self._deadline is not None:
            self._deadline.cancel()
            self._deadline = None

    def _too_slow(self) -> None:
        if self._idle or not self.cycle.response_started:
            self._refuse(
                408, "request_timeout", f"the request was not complete within {self.request_s:g} s: send it faster"
            )
        self.transport.close()

    def _refuse(self, status: int, code: str, detail: str) -> None:
        if self.conn.our_state not in {h11.IDLE, h11.SEND_RESPONSE} or self.transport.is_closing():
            self.transport.close()
            return
        phrase = {400: "Bad Request", 408: "Request Timeout"}[status]
        fields = {"type": "about:blank", "title": phrase, "status": status, "detail": detail, "code": code}
        body = json.dumps(fields).encode()
        headers = {
            **SECURITY_HEADERS,
            "content-type": MEDIA_TYPE,
            "content-length": str(len(body)),
            "connection": "close",
        }
        answer = h11.Response(status_code=status, headers=list(headers.items()), reason=phrase)
        for event in (answer, h11.Data(data=body), h11.EndOfMessage()):
            self.transport.write(self.conn.send(event) or b"")
        self.transport.close()

    def _make_room(self) -> None:
        idle = [each for each in self.connections if isinstance(each, GuardedConnection) and each._idle]
        oldest = min(idle, key=lambda each: each._last_heard, default=self)
        self.connections.discard(oldest)
        oldest.transport.abort()
