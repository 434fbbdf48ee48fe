"""Clients that are slow, many, rude or no clients at all: raw sockets against the real server."""

import contextlib
import socket
import threading
import time
from collections.abc import Iterator

import pytest

from tests.recorder.logs import ALL_OK
from tests.support.loopback import Loopback
from tests.support.waiting import wait_until
from tests.webpanel.memory_service import MemoryService, write_recording
from tests.webpanel.serving import Panel, serving
from webpanel.door.access import Access
from webpanel.server import GuardedConnection

JSON = b"Content-Type: application/json\r\n"
CLOSE = b"Connection: close\r\n\r\n"
HEAD = b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n"


@pytest.fixture
def hasty(service: MemoryService, loopback: Loopback, monkeypatch: pytest.MonkeyPatch) -> Iterator[Panel]:
    """A panel with little patience, so that the tests need little."""
    monkeypatch.setattr(GuardedConnection, "request_s", 0.5)
    monkeypatch.setattr(GuardedConnection, "stall_s", 0.5)
    with serving(service, Access.for_address(loopback.host, environment={})) as running:
        running.server.config.timeout_keep_alive = 1
        yield running


def read_all(raw: socket.socket) -> bytes:
    """Everything until the server closes."""
    received = b""
    with contextlib.suppress(ConnectionResetError):
        while piece := raw.recv(65536):
            received += piece
    return received


def exchange(panel: Panel, *pieces: bytes) -> bytes:
    """Send, and read until the server closes."""
    with panel.connect() as raw:
        for piece in pieces:
            raw.sendall(piece)
        return read_all(raw)


def test_answers_do_not_wait_for_acknowledgements(panel: Panel) -> None:
    with panel.client() as client:
        client.get("/healthz")
        (connection,) = panel.server.server_state.connections
        inside = connection.transport.get_extra_info("socket")
        assert inside.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)


def test_headers_drop_by_drop(hasty: Panel) -> None:
    with hasty.connect() as raw:
        began = time.monotonic()
        with contextlib.suppress(BrokenPipeError, ConnectionResetError):
            raw.sendall(HEAD)
            raw.settimeout(0.05)
            while time.monotonic() < began + 15:
                with contextlib.suppress(TimeoutError):
                    answer = raw.recv(4096)
                    break
                raw.sendall(b"X-More: 1\r\n")
    assert answer.startswith(b"HTTP/1.1 408 ")
    assert b"application/problem+json" in answer


def test_a_body_drop_by_drop(hasty: Panel) -> None:
    head = (
        b"POST /api/arm HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\nContent-Length: 60000\r\n\r\n"
    )
    with hasty.connect() as raw:
        raw.sendall(head)
        raw.settimeout(0.05)
        deadline, answer = time.monotonic() + 15, b""
        while not answer and time.monotonic() < deadline:
            with contextlib.suppress(TimeoutError):
                answer = raw.recv(4096)
                break
            raw.sendall(b" ")
    assert answer.startswith(b"HTTP/1.1 408 ")
    with hasty.client() as client:
        assert client.get("/api/status").json()["state"] == "idle"


def test_a_connection_that_says_nothing_ends(hasty: Panel) -> None:
    assert exchange(hasty).startswith(b"HTTP/1.1 408 ")
    with hasty.connect() as raw:
        raw.sendall(HEAD + b"\r\n")
        assert b"200 OK" in read_all(raw)  # ends: nothing further is asked


def test_who_does_not_read_is_dropped(hasty: Panel, service: MemoryService) -> None:
    write_recording(service.catalogue.directory, "long", (ALL_OK,) * 200)
    with hasty.connect() as raw:
        raw.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        raw.sendall(b"GET /api/recordings/long/file HTTP/1.1\r\nHost: localhost\r\n\r\n")
        wait_until(lambda: len(hasty.server.server_state.connections) == 1, "the client is connected")
        wait_until(lambda: not hasty.server.server_state.connections, "the client is dropped")
        wait_until(lambda: not hasty.server.server_state.tasks, "nothing is left of it")


def test_a_slow_start_after_an_answer_ends_too(hasty: Panel) -> None:
    with hasty.connect() as raw:
        raw.sendall(HEAD + b"\r\n" + HEAD)
        answer = read_all(raw)
    assert answer.startswith(b"HTTP/1.1 200 OK")


def test_a_slow_but_honest_client_is_served(hasty: Panel) -> None:
    for _ in range(5):
        with hasty.connect() as raw:
            for byte in HEAD + b"Connection: close\r\n\r\n":
                raw.sendall(bytes([byte]))
            assert read_all(raw).startswith(b"HTTP/1.1 200 OK")


NO_REQUESTS = [
    b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03",
    b"hello\r\n\r\n",
    b"GET / HTTP/9.9\r\n" + CLOSE,
    b"GET /healthz HTTP/1.1\r\nHost localhost\r\n\r\n",
    b"GET /healthz HTTP/1.1\r\nHost: a\r\nHost: b\r\n" + CLOSE,
    b"GET /healthz HTTP/1.1\r\n" + CLOSE,
    b"GET /\xff HTTP/1.1\r\nHost: localhost\r\n\r\n",
    b"POST /api/arm HTTP/1.1\r\nHost: localhost\r\nContent-Length: -1\r\n\r\n",
    b"POST /api/arm HTTP/1.1\r\nHost: localhost\r\nContent-Length: 1\r\nContent-Length: 2\r\n\r\n",
    b"POST /api/arm HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\nzz\r\n",
    b"GET /healthz HTTP/1.1\r\nHost: localhost\r\nX: " + b"a" * 20_000 + b"\r\n" + CLOSE,
    b"GET /" + b"a" * 20_000 + b" HTTP/1.1\r\nHost: localhost\r\n" + CLOSE,
    b"GET /healthz HTTP/1.1\r\nHost: localhost\r\n" + b"X: 1\r\n" * 4000 + CLOSE,
]


def test_what_is_no_request_is_refused_as_a_problem(panel: Panel) -> None:
    for request_bytes in NO_REQUESTS:
        answer = exchange(panel, request_bytes)
        assert answer.startswith((b"HTTP/1.1 400 ", b"HTTP/1.1 431 ")), request_bytes[:100]
        assert b"application/problem+json" in answer
        assert b"nosniff" in answer
        with panel.client() as client:
            assert client.get("/healthz").status_code == 200


def test_200_idle_connections_keep_nobody_out(panel: Panel) -> None:
    with contextlib.ExitStack() as idle, panel.client() as client:
        for _ in range(200):
            idle.enter_context(panel.connect())
        assert client.get("/api/status").status_code == 200
        assert client.get("/api/status").status_code == 200
        assert len(panel.server.server_state.connections) <= GuardedConnection.connections_max


def test_200_connections_with_half_a_request_keep_nobody_out(panel: Panel) -> None:
    with contextlib.ExitStack() as half, panel.client() as client:
        for _ in range(200):
            half.enter_context(panel.connect()).sendall(HEAD)
        assert client.get("/api/status").status_code == 200
        assert len(panel.server.server_state.connections) <= GuardedConnection.connections_max


def test_more_is_not_taken_while_all_are_busy(
    panel: Panel, client: object, service: MemoryService, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(GuardedConnection, "connections_max", 3)
    gate = threading.Event()
    monkeypatch.setattr(service, "doctor", lambda: (gate.wait(20), MemoryService.doctor(service))[1])
    with contextlib.ExitStack() as busy:
        raws = [busy.enter_context(panel.connect()) for _ in range(3)]
        for raw in raws:
            raw.sendall(b"GET /api/doctor HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n")
        wait_until(lambda: len(panel.server.server_state.tasks) == 3, "all three are busy")
        with panel.connect() as one_too_many:
            assert read_all(one_too_many) == b""
        gate.set()
        assert all(read_all(raw).startswith(b"HTTP/1.1 200 OK") for raw in raws)


def test_an_endless_body_is_neither_kept_nor_waited_for(hasty: Panel) -> None:
    head = b"POST /api/arm HTTP/1.1\r\nHost: localhost\r\n" + JSON + b"Transfer-Encoding: chunked\r\n\r\n"
    chunk = b"10000\r\n" + b" " * 65536 + b"\r\n"
    sent = 0
    with hasty.connect() as raw:
        raw.sendall(head)
        deadline = time.monotonic() + 15
        with contextlib.suppress(BrokenPipeError, ConnectionResetError):
            while time.monotonic() < deadline:
                raw.sendall(chunk)
                sent += len(chunk)
    assert time.monotonic() < deadline
    assert sent > 65536
    with hasty.client() as client:
        assert client.get("/api/status").json()["state"] == "idle"


def test_the_server_ends_while_clients_hang_on(service: MemoryService, loopback: Loopback) -> None:
    service.arm()
    with contextlib.ExitStack() as clients:
        with serving(service, Access.for_address(loopback.host, environment={})) as panel:
            for path in ("/api/events", "/api/preview.mjpg", "/api/preview.jpg?after=0"):
                raw = clients.enter_context(panel.connect())
                raw.sendall(f"GET {path} HTTP/1.1\r\nHost: localhost\r\n\r\n".encode())
                assert raw.recv(15).startswith(b"HTTP/1.1 200 OK")
            clients.enter_context(panel.connect())
        assert not service.listeners
