"""The REST client of `svev ctl`: JSON in, JSON out, refusals of the service as errors."""

import os
import ssl
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from http import HTTPStatus
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from rig.errors import BadInputError, ProcessDiedError, StorageError, SvevError
from rig.host.files import read_whole
from webpanel.door.tokens import TOKEN_VARIABLE

if TYPE_CHECKING:
    import httpx

#: The variable that names the file of a CA of one's own, beside which no other one counts.
_CA_VARIABLE: Final = "SVEV_CA"
_TIMEOUT_S: Final = 75.0  # closing a log may wait for the disk for a minute
_TOKEN_FILE_MAX: Final = 16_000
_TOKEN_NEEDED: Final = frozenset({HTTPStatus.UNAUTHORIZED, HTTPStatus.FORBIDDEN})
_BAD_INPUT: Final = _TOKEN_NEEDED | {
    HTTPStatus.BAD_REQUEST, HTTPStatus.NOT_FOUND, HTTPStatus.UNPROCESSABLE_ENTITY, HTTPStatus.METHOD_NOT_ALLOWED,
}  # fmt: skip


class RestClient:
    """Calls one service.

    Args:
        url: where the service listens, e.g. `http://127.0.0.1:8000`.
        token: the token that the service asks for, empty if it asks for none.

    Raises:
        BadInputError: the address is not one of a service, or the token holds a character that no token has.
    """

    def __init__(self, url: str, token: str = "") -> None:
        if url.partition("://")[0].lower() not in {"http", "https"}:
            raise _no_address(url)
        if not token.isascii() or not token.isprintable():
            raise BadInputError(f"the token is not one line of letters, digits and signs: look at {TOKEN_VARIABLE}")
        self._url, self._token = url.rstrip("/"), token

    def call(self, method: str, path: str, body: Mapping[str, Any] | bytes | None = None) -> Any:
        """Call the API.

        Args:
            method: e.g. GET.
            path: below the service's address, e.g. `/api/status`.
            body: sent as JSON, bytes as a table (CSV); None: the request has no body.

        Raises:
            BadInputError: the service refuses what was sent, or the token.
            StorageError: no room.
            SvevError: the service's state forbids it; the message says what to do.
            ProcessDiedError: the service does not answer, or failed.
        """
        with self.answering(method, path, body) as answer:
            try:
                answer.read()
                return answer.json()
            except ValueError:
                text = f"{self._url} answers no JSON: give the address of svev serve with --url"
                raise ProcessDiedError(text) from None

    @contextmanager
    def answering(
        self,
        method: str,
        path: str,
        body: Mapping[str, Any] | bytes | None = None,
        more: Mapping[str, str] | None = None,
    ) -> "Iterator[httpx.Response]":
        """A successful answer, whose content is still to be read; arguments and errors as for `call`.

        Args:
            method: e.g. GET.
            path: below the service's address.
            body: sent as JSON.
            more: further headers.
        """
        import httpx  # noqa: PLC0415 - takes 70 ms to import, which --help need not wait for

        headers = {"Accept": "application/json", **(more or {})}
        if self._token:
            headers["Authorization"] = f"Bearer {self._token}"
        table = body if isinstance(body, bytes) else None
        if table is not None:
            headers["Content-Type"] = "text/csv"
        try:
            # Neither proxies (trust_env) nor redirects: the service is on this computer or in the network at the hill,
            # and nobody else is to get the token. Certificates are loaded (0.1 s) only where there is one to check.
            with httpx.stream(
                method, self._url + path, json=body if table is None else None, content=table, headers=headers,
                timeout=_TIMEOUT_S, trust_env=False, follow_redirects=False,
                verify=_trusted(os.environ) if self._url.startswith("https:") else False,
            ) as answer:  # fmt: skip
                if not answer.is_success:
                    answer.read()
                    raise _refusal(answer)
                yield answer
        except httpx.InvalidURL:
            raise _no_address(self._url) from None
        except httpx.HTTPError as error:
            raise ProcessDiedError(
                f"{self._url} does not answer ({error}): start it with svev serve, or give its address with --url"
            ) from None


def read_token(file: Path | None, environment: Mapping[str, str] = os.environ) -> str:
    """The token from a file or from the environment, empty if there is none.

    Raises:
        BadInputError: the file cannot be read.
    """
    if file is None:
        return environment.get(TOKEN_VARIABLE, "").strip()
    try:
        return read_whole(file, _TOKEN_FILE_MAX, links=True).decode("utf-8").strip()
    except OSError as error:
        raise BadInputError(f"{file}: token cannot be read ({error.strerror}); check path and permissions") from None
    except UnicodeDecodeError:
        raise BadInputError(f"{file}: token cannot be read (no text); check path and permissions") from None


def _trusted(environment: Mapping[str, str]) -> ssl.SSLContext:
    """Trust the CA that the variable SVEV_CA names, or those of this computer."""
    file = environment.get(_CA_VARIABLE) or None
    try:
        return ssl.create_default_context(cafile=file)
    except OSError as error:
        reason = error.strerror or error
        raise BadInputError(
            f"{file}: no certificate of a CA that can be read ({reason}); look at {_CA_VARIABLE}"
        ) from None


def _no_address(url: str) -> BadInputError:
    return BadInputError(f"{url}: no address of a service; give one like http://127.0.0.1:8000")


def _refusal(answer: "httpx.Response") -> SvevError:
    """The error that corresponds to a refusal of the service."""
    try:
        detail = str(answer.json()["detail"])
    except (ValueError, KeyError, TypeError):
        detail = f"the service answers {answer.status_code} {answer.reason_phrase}; is it svev serve?"
    if answer.status_code in _TOKEN_NEEDED:
        detail += f" (a token goes into {TOKEN_VARIABLE} or --token-file)"
    if answer.status_code in _BAD_INPUT:
        return BadInputError(detail)
    if answer.status_code == HTTPStatus.CONFLICT:
        return SvevError(detail)
    if answer.status_code == HTTPStatus.INSUFFICIENT_STORAGE:
        return StorageError(detail)
    return ProcessDiedError(detail)
