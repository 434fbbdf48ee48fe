"""Keeps the links that were made in a file of the recordings' folder, and which of them were taken back."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Final

from pydantic import Field, ValidationError

from rig.api.fields import Model
from rig.host.disk import replace_file
from rig.host.files import read_own
from rig.host.latest import LatestWriter
from rig.phrase import Phrase, phrase

NAME: Final = ".svev-links.json"
_MOST_BYTES: Final = 4_000_000
_KEEP_S: Final = 5.0


class KeptLink(Model):
    """A link.

    Attributes:
        recording: what it opens.
        minute: UNIX time at which it ends, minutes; with the recording it says which link it is.
        made: UNIX time, s.
        taken_back: it opens nothing any more.
    """

    recording: str
    minute: int = Field(ge=0, lt=1 << 32)
    made: float
    taken_back: bool = False


class _Kept(Model):
    links: tuple[KeptLink, ...]


class LinkFile:
    """Reads once, and writes in a thread of its own.

    Attributes:
        broken: there is a file, but nobody knows what was taken back: all links made until now must end.
        links: that were kept.

    Args:
        folder: of the recordings.
        lament: told once that links cannot be kept.
    """

    def __init__(self, folder: Path, lament: Callable[[Phrase], None]) -> None:
        self._path, self._lament = folder / NAME, lament
        self._writer = LatestWriter("links", self._refused)
        self.broken = False
        self.links: tuple[KeptLink, ...] = ()
        try:
            self.links = _Kept.model_validate_json(read_own(self._path, _MOST_BYTES)).links
        except FileNotFoundError:
            pass  # none was made yet
        except (OSError, ValidationError) as error:
            self.broken = True
            text = "{path} cannot be read ({why}): all links to jumps end; show the codes again"
            why = (error.strerror if isinstance(error, OSError) else None) or "it is none of this version of svev"
            lament(phrase("event_links_unreadable", text, path=str(self._path), why=why))

    def keep(self, links: Iterable[KeptLink]) -> None:
        """Begin to write the links."""
        kept = _Kept(links=tuple(links))
        self._writer.write(lambda: replace_file(self._path, kept.model_dump_json().encode(), links=False))

    def is_kept(self) -> bool:
        """Wait until the links that were given last are on the disk; False if it refuses them, or hangs."""
        return self._writer.wait(_KEEP_S) and not self._writer.failed

    def _refused(self, error: OSError) -> None:
        text = "{path} cannot be written ({why}): a link that is taken back opens its jump again after a restart"
        self._lament(phrase("event_links_not_kept", text, path=str(self._path), why=error.strerror or str(error)))
