"""Sends one notification to the webhook: one POST with a deadline, whatever the receiver does."""

import socket
import ssl
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from http import HTTPStatus
from http.client import HTTPConnection, HTTPException, HTTPSConnection
from pathlib import Path
from typing import Final
from urllib.parse import urlsplit

from rig.errors import BadInputError
from rig.host.files import open_to_read
from rig.phrase import Phrase, phrase
from rig.settings.webhook import WebhookSettings, checked_url

#: A receiver that has not answered after this time is given up, s.
DEADLINE_S: Final = 10.0
_FILE_MAX: Final = 4096
#: The receiver asks to try again later; every other refusal of a request is for good.
_LATER: Final = frozenset({HTTPStatus.REQUEST_TIMEOUT, HTTPStatus.TOO_EARLY, HTTPStatus.TOO_MANY_REQUESTS})


@dataclass(frozen=True, slots=True)
class Failure:
    """Why a notification was not delivered.

    Attributes:
        said: why, with what to do; it holds neither token nor the path of the address, which may be secret.
        final: whether it is useless to send the same again.
    """

    said: Phrase
    final: bool = False


@dataclass(frozen=True, slots=True)
class Target:
    """Where notifications go.

    Attributes:
        url: the address.
        token: sent as `Authorization: Bearer …`; empty: none.
    """

    url: str = field(repr=False)
    token: str = field(default="", repr=False)

    @property
    def host(self) -> str:
        """Host of the address, to name it to people."""
        return urlsplit(self.url).hostname or ""


def read_target(webhook: WebhookSettings) -> Target:
    """The address and the token, from their files where the rig file names some.

    Raises:
        BadInputError: a file cannot be read, or holds no address or token; the message quotes neither.
    """
    url = webhook.url or ""
    if webhook.url_file is not None:
        try:
            url = checked_url(_line(webhook.url_file, "address"))
        except ValueError as error:
            raise BadInputError(f"{webhook.url_file}: {error}") from None
    return Target(url, "" if webhook.token_file is None else _line(webhook.token_file, "token"))


def _line(file: Path, what: str) -> str:
    try:
        with open_to_read(file, links=True) as opened:
            text = opened.read(_FILE_MAX).decode("ascii").strip()
    except OSError as error:
        raise BadInputError(f"{file}: cannot be read ({error.strerror}); check path and permissions") from None
    except ValueError:
        text = ""
    if not text or not text.isprintable() or " " in text:
        raise BadInputError(f"{file}: holds no {what}: write it there, alone, on one line without spaces")
    return text


def deliver(target: Target, body: bytes, deadline_s: float = DEADLINE_S) -> Failure | None:
    """Send a notification; redirections are not followed, for they might carry the token elsewhere.

    Args:
        target: where to.
        body: the JSON.
        deadline_s: longest time from the connection to the answer, and longest time to connect, s.

    Returns:
        None: the receiver has it.
    """
    place = urlsplit(target.url)
    host = place.hostname or ""
    headers = {"Content-Type": "application/json", "User-Agent": "svev", "Connection": "close"}
    if target.token:
        headers["Authorization"] = f"Bearer {target.token}"
    connection: HTTPConnection
    if place.scheme == "https":
        connection = HTTPSConnection(host, place.port, timeout=deadline_s, context=ssl.create_default_context())
    else:
        connection = HTTPConnection(host, place.port, timeout=deadline_s)
    until = time.monotonic() + deadline_s
    try:
        connection.connect()
        with _cut_off(connection.sock, until - time.monotonic()):
            path = (place.path or "/") + (f"?{place.query}" if place.query else "")
            connection.request("POST", path, body, headers)
            answer = connection.getresponse()
    except (OSError, HTTPException, ValueError) as error:
        if isinstance(error, TimeoutError) or time.monotonic() >= until:
            text = "{host} did not answer within {seconds:g} s: see whether it runs and can be reached"
            return Failure(phrase("webhook_silent", text, host=host, seconds=deadline_s))
        text = "{host} cannot be reached ({why}): see whether it runs, and its name and port"
        return Failure(phrase("webhook_away", text, host=host, why=_why(error)))
    finally:
        connection.close()
    return _judge(host, answer.status)


def _judge(host: str, status: int) -> Failure | None:
    if HTTPStatus.OK <= status < HTTPStatus.MULTIPLE_CHOICES:
        return None
    if status < HTTPStatus.BAD_REQUEST:
        text = "{host} redirects ({status}), which is not followed: give the address that it leads to"
        return Failure(phrase("webhook_redirects", text, host=host, status=status), final=True)
    if status >= HTTPStatus.INTERNAL_SERVER_ERROR or status in _LATER:
        return Failure(phrase("webhook_fails", "{host} answers {status}: look at its log", host=host, status=status))
    text = "{host} answers {status}: look at the address and the token"
    return Failure(phrase("webhook_refuses", text, host=host, status=status), final=True)


def _why(error: Exception) -> str:
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    return str(error) or type(error).__name__


@contextmanager
def _cut_off(connection: socket.socket, seconds: float) -> Iterator[None]:
    """Within, the connection is cut after some seconds: a receiver that sends byte by byte meets every timeout."""

    def cut() -> None:
        with suppress(OSError):  # it is closed already
            socket.socket.shutdown(connection, socket.SHUT_RDWR)

    timer = threading.Timer(max(0.0, seconds), cut)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        timer.join()
