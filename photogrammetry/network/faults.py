"""Collects what is wrong in a file, so that one message can name all of it."""

from collections.abc import Callable, Iterable
from typing import Any, Final, TypeVar

from rig.errors import BadInputError

Key = TypeVar("Key", str, int)
Made = TypeVar("Made")

_MOST_NAMED: Final = 20  # things that are wrong, in one message


class WrongEntryError(Exception):
    """What is wrong with one entry of a file: one or several things, each with its place."""

    def __init__(self, *messages: str):
        super().__init__(*messages)
        self.messages = messages


class Faults:
    """Collects what is wrong in a file, so that one message can name all of it."""

    def __init__(self, source: str) -> None:
        self._source = source
        self._found: list[str] = []

    def each(self, bodies: Iterable[tuple[Key, Any]], make: Callable[[Key, Any], Made]) -> tuple[Made, ...]:
        """Make something of each entry of the file, except of those that are wrong."""
        made = []
        for key, body in bodies:
            try:
                made.append(make(key, body))
            except WrongEntryError as error:
                self._found += error.messages
        return tuple(made)

    def add(self, messages: Iterable[str]) -> None:
        """Add what is wrong with the file as a whole."""
        self._found += messages

    def raise_any(self) -> None:
        """Raise BadInputError with everything that was found, if something was."""
        if len(self._found) == 1:
            raise BadInputError(f"{self._source}: {self._found[0]}")
        if self._found:
            shown = " ".join(f"({i}) {message}" for i, message in enumerate(self._found[:_MOST_NAMED], start=1))
            more = f" (and {len(self._found) - _MOST_NAMED} more)" if len(self._found) > _MOST_NAMED else ""
            raise BadInputError(f"{self._source}: {len(self._found)} things are wrong: {shown}{more}")
