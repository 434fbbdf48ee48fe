"""The REST client of `svev ctl` against servers that are not `svev serve`."""

import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from rig.errors import BadInputError, ProcessDiedError, StorageError, SvevError
from svev.rest_client import RestClient
from tests.support.loopback import Loopback

TOKEN = "a-token-for-the-tests-only"  # noqa: S105


@contextmanager
def answering(host: str, answer: bytes) -> Iterator[tuple[str, list[bytes]]]:
    """A server that gives one connection this answer, whatever was asked: its address, and what it was sent."""
    heard: list[bytes] = []
    with socket.create_server((host, 0)) as listener:

        def serve() -> None:
            connection, _ = listener.accept()
            with connection:
                heard.append(connection.recv(65536))
                connection.sendall(answer)

        thread = threading.Thread(target=serve)
        thread.start()
        yield f"http://{host}:{listener.getsockname()[1]}", heard
        thread.join(20)
        assert not thread.is_alive()


def _http(status: str, body: str = "", *headers: str) -> bytes:
    lines = [f"HTTP/1.1 {status}", f"Content-Length: {len(body)}", *headers, "", body]
    return "\r\n".join(lines).encode()


@pytest.mark.parametrize(
    ("answer", "error", "text"),
    [
        (_http("200 OK", "<html>"), ProcessDiedError, "answers no JSON: give the address of svev serve with --url"),
        (_http("204 No Content"), ProcessDiedError, "answers no JSON"),
        (b"SSH-2.0-OpenSSH_9.2\r\n", ProcessDiedError, "does not answer .*: start it with svev serve"),
        (b"", ProcessDiedError, "does not answer .*: start it with svev serve"),
        (_http("500 Internal Server Error", "oops"), ProcessDiedError, "the service answers 500 Internal Server Error"),
        (_http("403 Forbidden"), BadInputError, r"\(a token goes into SVEV_TOKEN or --token-file\)"),
        (_http("409 Conflict", '{"detail": "arm it first"}'), SvevError, "^arm it first$"),
        (_http("507 Insufficient Storage", '{"detail": "full"}'), StorageError, "^full$"),
    ],
)
def test_what_is_no_answer_becomes_an_error(
    loopback: Loopback, answer: bytes, error: type[SvevError], text: str
) -> None:
    with answering(loopback.host, answer) as (url, _), pytest.raises(error, match=text) as refusal:
        RestClient(url).call("GET", "/api/status")
    assert type(refusal.value) is error


def test_the_token_goes_to_the_service_alone(loopback: Loopback, monkeypatch: pytest.MonkeyPatch) -> None:
    elsewhere = f"http://{loopback.host}:{loopback.free_port()}"
    for variable in ("http_proxy", "HTTP_PROXY", "all_proxy"):
        monkeypatch.setenv(variable, elsewhere)
    redirect = _http("307 Temporary Redirect", "", f"Location: {elsewhere}/")
    refused = pytest.raises(ProcessDiedError, match="the service answers 307 Temporary Redirect; is it svev serve")
    with answering(loopback.host, redirect) as (url, heard), refused:
        RestClient(url, TOKEN).call("POST", "/api/recordings", {"athlete": "Øye"})
    (request,) = heard
    assert request.startswith(b"POST /api/recordings HTTP/1.1\r\n")
    assert f"Authorization: Bearer {TOKEN}\r\n".encode() in request


@pytest.mark.parametrize("url", ["127.0.0.1:8000", "ftp://127.0.0.1", "http://127.0.0.1:port"])
def test_an_address_that_is_none(url: str) -> None:
    with pytest.raises(BadInputError, match="no address of a service; give one like"):
        RestClient(url).call("GET", "/api/status")


def test_a_token_that_no_header_can_hold_is_not_repeated() -> None:
    with pytest.raises(BadInputError, match="the token is not one line") as refusal:
        RestClient("http://127.0.0.1:8000", "first\nsecond")
    assert "second" not in str(refusal.value)
