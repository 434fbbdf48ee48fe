"""Asks one question after the other at a terminal; or takes the answers that were given as options."""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import TextIO, TypeVar

from rig.errors import BadInputError
from svev import console
from svev.setup.answers import Language
from svev.setup.words import said

T = TypeVar("T")
_YES, _NO = frozenset({"y", "yes", "j", "ja"}), frozenset({"n", "no", "nei"})


@dataclass(slots=True)
class Dialog:
    """Questions and answers.

    Attributes:
        asks: whether there is somebody to ask; otherwise defaults are taken.
        aside: whether what is said goes to standard error, because the result is to stand alone on standard output.
        language: of the questions.
    """

    asks: bool
    aside: bool = False
    language: Language = "en"

    def say(self, word: str, **values: object) -> None:
        """Say something; `word` is its key in `svev.setup.words`."""
        console.say(said(self.language, word, **values), aside=self.aside)

    def plain(self, line: str) -> None:
        """Say a line that needs no translation."""
        console.say(line, aside=self.aside)

    def ask(
        self,
        word: str,
        option: str,
        given: str | None,
        default: str | None,
        check: Callable[[str], T],
        **values: object,
    ) -> T:
        """The answer to a question.

        Args:
            word: key of the question.
            option: by which it is answered on the command line.
            given: the answer that was given there.
            default: the answer if nothing is typed; None: there must be one.
            check: makes a value of the answer.
            values: names and numbers in the question.

        Raises:
            BadInputError: the answer on the command line is wrong, or nobody can be asked and there is no default.
            KeyboardInterrupt: who is asked has left.
        """
        if given is not None:
            return _checked(check, given, option)
        if not self.asks:
            if default is None:
                raise BadInputError(f"{said('en', word, **values)} give it by {option}")
            return _checked(check, default, option)
        while True:
            answer = self._read(word, default, values)
            try:
                return check(answer)
            except BadInputError as error:
                self.plain(f"  {error}")

    def confirm(self, word: str, given: bool | None, *, default: bool, **values: object) -> bool:
        """The answer to a question that is answered by yes or no."""
        if given is not None:
            return given
        if not self.asks:
            return default
        shown = said(self.language, "yes" if default else "no")
        while True:
            answer = self._read(word, shown, values).lower()
            if answer in _YES | _NO:
                return answer in _YES
            self.say("yes_or_no")

    def _read(self, word: str, default: str | None, values: dict[str, object]) -> str:
        stream: TextIO = sys.stderr if self.aside else sys.stdout
        hint = f" [{default}]" if default else ""
        stream.write(console.visible(f"{said(self.language, word, **values)}{hint} "))
        stream.flush()
        line = sys.stdin.readline()
        if not line:  # Ctrl-D: nobody answers any more
            raise KeyboardInterrupt
        return line.strip() or (default or "")


def _checked(check: Callable[[str], T], text: str, option: str) -> T:
    try:
        return check(text)
    except BadInputError as error:
        raise BadInputError(f"{option} {error}") from None
