"""Fetching files from a service whose connection breaks, or which sends something else."""

import hashlib
import re
import socket
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import pytest

from rig.errors import BadInputError, ProcessDiedError, SvevError
from svev.fetch import fetch
from svev.rest_client import RestClient
from tests.support.loopback import Loopback

CONTENT = bytes(range(256)) * 40
NAME = "attachment; filename=\"17_Bjorn.mcap\"; filename*=UTF-8''17_Bj%C3%B8rn.mcap"


@contextmanager
def serving(host: str, answers: Sequence[bytes]) -> Iterator[tuple[str, list[str]]]:
    """A server that gives each connection the next of these answers: its address, and what was asked."""
    heard: list[str] = []
    with socket.create_server((host, 0)) as listener:

        def serve() -> None:
            for answer in answers:
                connection, _ = listener.accept()
                with connection:
                    heard.append(connection.recv(65536).decode())
                    connection.sendall(answer)

        thread = threading.Thread(target=serve)
        thread.start()
        yield f"http://{host}:{listener.getsockname()[1]}", heard
        thread.join(20)
        assert not thread.is_alive()


def _answer(status: str, body: bytes, size: int | None = None, name: str = NAME) -> bytes:
    head = f'HTTP/1.1 {status}\r\nContent-Length: {len(body) if size is None else size}\r\nETag: "a"\r\n'
    return f"{head}Content-Disposition: {name}\r\nConnection: close\r\n\r\n".encode() + body


SUM = _answer("200 OK", f"{hashlib.sha256(CONTENT).hexdigest()}  17.mcap\n".encode())


def test_a_connection_that_breaks_goes_on_where_it_broke(loopback: Loopback, tmp_path: Path) -> None:
    answers = (
        _answer("200 OK", CONTENT[:3000], len(CONTENT)),
        _answer("206 Partial Content", CONTENT[3000:4000], len(CONTENT) - 3000),
        _answer("206 Partial Content", CONTENT[4000:]),
        SUM,
    )
    seen: list[tuple[int, int]] = []
    with serving(loopback.host, answers) as (url, heard):
        found = fetch(RestClient(url), "/file", tmp_path, lambda have, of: seen.append((have, of)))
    assert (found.name, found.read_bytes()) == ("17_Bj\u00f8rn.mcap", CONTENT)
    wanted = [re.findall(r"^(range|if-range): (.*)\r$", each, re.MULTILINE | re.IGNORECASE) for each in heard]
    assert [sorted(value for _, value in each) for each in wanted] == [
        [], ['"a"', "bytes=3000-"], ['"a"', "bytes=4000-"], [],
    ]  # fmt: skip
    assert seen[-1] == (len(CONTENT), len(CONTENT))
    assert list(tmp_path.iterdir()) == [found]


@pytest.mark.parametrize(
    ("answers", "error", "text"),
    [
        ((_answer("200 OK", CONTENT[::-1]), SUM), SvevError, "what came is not what the service has"),
        ((_answer("200 OK", CONTENT, name="inline"),), ProcessDiedError, "does not say how the file is called"),
        ((_answer("200 OK", CONTENT, name='attachment; filename=".."'),), ProcessDiedError, "how the file is called"),
        ((_answer("200 OK", CONTENT, name='attachment; filename="../there"'),), BadInputError, "exists already"),
    ],
)
def test_what_is_not_as_it_should_be_leaves_nothing(
    loopback: Loopback, tmp_path: Path, answers: tuple[bytes, ...], error: type[SvevError], text: str
) -> None:
    (tmp_path / "there").write_text("precious")
    with serving(loopback.host, answers) as (url, _), pytest.raises(error, match=text):
        fetch(RestClient(url), "/file", tmp_path, lambda *_: None)
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [("there", "precious")]
