"""Fetches files from a service: a connection that breaks goes on where it broke, and what came is checked."""

import hashlib
import re
import urllib.parse
from collections.abc import Callable
from http import HTTPStatus
from pathlib import Path
from typing import TYPE_CHECKING, Final

from rig.errors import BadInputError, ProcessDiedError, SvevError
from rig.host.file_names import give_name
from svev.rest_client import RestClient

if TYPE_CHECKING:
    import httpx

#: How often a connection is made before it is given up.
_ATTEMPTS: Final = 5
_EXTENDED: Final = re.compile(r"filename\*=UTF-8''([^;]+)")
_PLAIN: Final = re.compile(r'filename="([^"]+)"')


def fetch(client: RestClient, path: str, folder: Path, progress: Callable[[int, int], None]) -> Path:
    """Fetch a file under the name that the service gives it.

    What comes is written to a file of that name with `.part` behind it, which is renamed when it is whole and its
    checksum is right.

    Args:
        client: calls the service.
        path: of the file; its checksum is at the same path with `.sha256` behind it.
        folder: where to put it.
        progress: called with the bytes that are there, and those that there will be.

    Returns:
        The file.

    Raises:
        BadInputError: there is a file of this name already, it cannot be written, or the service refuses.
        SvevError: the service's state forbids it, or what came is not what the service has.
        ProcessDiedError: the service does not answer, or the connection breaks again and again.
    """
    coming = _Coming(folder, progress)
    for attempt in range(1, _ATTEMPTS + 1):
        try:
            with client.answering("GET", path, more=coming.headers()) as answer:
                coming.take(answer)
            break
        except ProcessDiedError:
            if not coming.have or attempt == _ATTEMPTS:
                raise
    with client.answering("GET", f"{path}.sha256") as answer:
        answer.read()
        return coming.finish(answer.text.partition(" ")[0])


class _Coming:
    """A file on its way.

    Attributes:
        have: bytes that are there.
    """

    def __init__(self, folder: Path, progress: Callable[[int, int], None]) -> None:
        self._folder, self._progress = folder, progress
        self._target = self._part = folder
        self._tag, self._total, self.have = "", 0, 0

    def headers(self) -> dict[str, str]:
        """What to ask for: everything, or the rest of the same file."""
        return {"Range": f"bytes={self.have}-", "If-Range": self._tag} if self.have else {}

    def take(self, answer: "httpx.Response") -> None:
        """Write what comes."""
        if answer.status_code != HTTPStatus.PARTIAL_CONTENT:
            self._begin(answer)
        try:
            with self._part.open("r+b" if self.have else "wb") as file:
                file.seek(self.have)
                for piece in answer.iter_bytes():
                    file.write(piece)
                    self.have += len(piece)
                    self._progress(self.have, self._total)
        except OSError as error:
            text = f"{self._part}: cannot be written ({error.strerror}); choose another folder with -o"
            raise BadInputError(text) from None

    def finish(self, checksum: str) -> Path:
        """Give the file its name if it has this checksum."""
        with self._part.open("rb") as file:
            found = hashlib.file_digest(file, "sha256").hexdigest()
        if found != checksum:
            self._part.unlink()
            text = f"{self._target.name}: what came is not what the service has; it was corrected meanwhile? try again"
            raise SvevError(text)
        try:
            give_name(self._part, self._target)
        except FileExistsError:
            raise BadInputError(_taken(self._target)) from None
        except OSError as error:
            text = (
                f"{self._target}: cannot be written ({error.strerror}); what came is whole, and stays in {self._part}"
            )
            raise BadInputError(text) from None
        return self._target

    def _begin(self, answer: "httpx.Response") -> None:
        self.have, self._tag = 0, answer.headers.get("etag", "")
        self._total = int(answer.headers.get("content-length", 0))
        self._target = self._folder / _name_in(answer.headers.get("content-disposition", ""))
        self._part = self._target.with_name(f"{self._target.name}.part")
        if self._target.exists():
            raise BadInputError(_taken(self._target))


def _taken(target: Path) -> str:
    return f"{target}: exists already and is never overwritten; remove it first"


def _name_in(disposition: str) -> str:
    """The name that a header gives a file, without any path."""
    extended, plain = _EXTENDED.search(disposition), _PLAIN.search(disposition)
    name = urllib.parse.unquote(extended[1]) if extended else plain[1] if plain else ""
    name = Path(name).name
    if not name.isprintable() or not name.strip("."):
        raise ProcessDiedError("the service does not say how the file is called; is it svev serve?")
    return name
