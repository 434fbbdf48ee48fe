"""A client of the service's REST API: JSON in, JSON out, refusals as errors."""

import json
import os
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Mapping
from http import HTTPStatus
from pathlib import Path
from typing import Any, Final

from rig.errors import BadInputError, ProcessDiedError, StorageError, SvevError
from webpanel.access import TOKEN_VARIABLE

_TIMEOUT_S: Final = 75.0  # closing a log may wait for the disk for a minute
_TOKEN_NEEDED: Final = frozenset({HTTPStatus.UNAUTHORIZED, HTTPStatus.FORBIDDEN})
_BAD_INPUT: Final = _TOKEN_NEEDED | {
    HTTPStatus.BAD_REQUEST, HTTPStatus.NOT_FOUND, HTTPStatus.UNPROCESSABLE_ENTITY, HTTPStatus.METHOD_NOT_ALLOWED,
}  # fmt: skip


class RestClient:
    """Calls one service.

    Args:
        url: where it listens, e.g. `http://127.0.0.1:8000`.
        token: what it wants to know of those who call from elsewhere, empty if nothing.

    Raises:
        BadInputError: the address is none.
    """

    def __init__(self, url: str, token: str = "") -> None:
        if urllib.parse.urlsplit(url).scheme not in {"http", "https"}:
            raise BadInputError(f"{url}: no address of a service; give one like http://127.0.0.1:8000")
        self._url, self._token = url.rstrip("/"), token

    def call(self, method: str, path: str, body: Mapping[str, Any] | None = None) -> Any:
        """Call the API.

        Args:
            method: e.g. GET.
            path: under the service's address, e.g. `/api/status`.
            body: what to send as JSON, None: nothing.

        Raises:
            BadInputError: the service refuses what was sent, or the token.
            StorageError: no room.
            SvevError: the service's state forbids it; the message says what to do.
            ProcessDiedError: the service does not answer, or failed.
        """
        headers = {"Accept": "application/json"}
        data = None
        if body is not None:
            data, headers["Content-Type"] = json.dumps(body).encode(), "application/json"
        if self._token:
            headers["Authorization"] = f"Bearer {self._token}"
        request = urllib.request.Request(self._url + path, data, headers, method=method)  # noqa: S310 - checked above
        try:
            with _direct().open(request, timeout=_TIMEOUT_S) as answer:
                return json.load(answer)
        except urllib.error.HTTPError as error:
            with error:
                raise _refusal(error) from None
        except OSError as error:
            reason = getattr(error, "reason", error)
            raise ProcessDiedError(
                f"{self._url} does not answer ({reason}): start it with svev serve, or give its address with --url"
            ) from None
        except ValueError:
            raise ProcessDiedError(f"{self._url} answers no JSON: give the address of svev serve with --url") from None


def read_token(file: Path | None, environment: Mapping[str, str] = os.environ) -> str:
    """The token from a file or from the environment, empty if there is none.

    Raises:
        BadInputError: the file cannot be read.
    """
    if file is None:
        return environment.get(TOKEN_VARIABLE, "").strip()
    try:
        return file.read_text(encoding="utf-8").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise BadInputError(f"{file}: token cannot be read ({error}); check path and permissions") from None


class _NoRedirect(urllib.request.HTTPRedirectHandler):
    """The token goes to the service alone, wherever that may point."""

    def redirect_request(self, *_: object) -> None:
        """Follow nothing: the answer is an error then."""


def _direct() -> urllib.request.OpenerDirector:
    """Neither proxies nor redirects: the service is on this computer, or in the network at the hill."""
    return urllib.request.build_opener(urllib.request.ProxyHandler({}), _NoRedirect)


def _refusal(error: urllib.error.HTTPError) -> SvevError:
    """A refusal of the service as an error."""
    try:
        detail = str(json.load(error)["detail"])
    except (ValueError, KeyError, TypeError, OSError):
        detail = f"the service answers {error.code} {error.reason}; is it svev serve?"
    if error.code in _TOKEN_NEEDED:
        detail += f" (a token goes into {TOKEN_VARIABLE} or --token-file)"
    if error.code in _BAD_INPUT:
        return BadInputError(detail)
    if error.code == HTTPStatus.CONFLICT:
        return SvevError(detail)
    if error.code == HTTPStatus.INSUFFICIENT_STORAGE:
        return StorageError(detail)
    return ProcessDiedError(detail)
