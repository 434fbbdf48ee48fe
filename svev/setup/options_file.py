"""The options of the service, a file that systemd reads: which of them are asked for is changed, the rest stays."""

import re
import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from rig.errors import BadInputError
from rig.settings.strict_toml import read_text

_VARIABLE: Final = "SVEV_OPTIONS"
_LINE: Final = re.compile(rf"^{_VARIABLE}=(.*)$", re.MULTILINE)
_LOOPBACK: Final = "127.0.0.1"
#: Options whose values are asked for; all take one.
_ASKED: Final = frozenset({"--host", "--token-file", "--allow-host", "--tls-certificate", "--tls-key"})
_PORT: Final = 8000
_HEAD: Final = (
    "# Options of the service, as on the command line of `svev serve`. After a change: sudo systemctl restart svev\n"
)


@dataclass(frozen=True, slots=True)
class ServiceOptions:
    """The options of `svev serve` in a file.

    Attributes:
        text: of the whole file.
        words: the options, each with its value as the next word.
    """

    text: str
    words: tuple[str, ...]

    @classmethod
    def read(cls, path: Path) -> "ServiceOptions":
        """The options of a file; none if it is missing.

        Raises:
            BadInputError: the file cannot be read, or has a quotation mark without another.
        """
        text = read_text(path, "options", "one") if path.exists() else _HEAD
        found = _LINE.findall(text)
        try:
            words = shlex.split(found[-1]) if found else []
        except ValueError as error:
            raise BadInputError(f"{path}: {error}; correct the line {_VARIABLE}=") from None
        flat = [part for word in words for part in (word.split("=", 1) if word.startswith("--") else [word])]
        return cls(text, tuple(flat))

    def values(self, option: str) -> tuple[str, ...]:
        """The values that an option is given."""
        following = zip(self.words, self.words[1:], strict=False)
        return tuple(value for word, value in following if word == option)

    @property
    def host(self) -> str:
        """The address that the page listens on."""
        return next(iter(self.values("--host")), _LOOPBACK)

    @property
    def port(self) -> int:
        """The port of the page."""
        found = next(iter(self.values("--port")), "")
        return int(found) if found.isdecimal() else _PORT

    @property
    def names(self) -> tuple[str, ...]:
        """The names that the page answers to."""
        return self.values("--allow-host")

    @property
    def phones(self) -> bool:
        """Whether other computers reach the page."""
        return self.host not in {_LOOPBACK, "localhost", "::1"}

    @property
    def https(self) -> bool:
        """Whether the page has a certificate."""
        return bool(self.values("--tls-certificate"))

    def with_access(self, asked: list[str]) -> "ServiceOptions":
        """The options with others of who may reach the page; everything else in the file stays.

        Args:
            asked: host, token, names and certificate, each option with its value behind it.
        """
        kept, left = [], list(self.words)
        while left:
            word = left.pop(0)
            if word in _ASKED:
                left = left[1:]
            else:
                kept.append(word)
        words = [*asked, *kept]
        line = f"{_VARIABLE}={shlex.join(words)}" if words else ""
        text = _LINE.sub("", self.text).rstrip("\n")
        return ServiceOptions(f"{text}\n{line}\n" if line else f"{text}\n", tuple(words))
