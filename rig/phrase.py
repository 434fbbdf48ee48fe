"""Sentences that can be said in another language: a stable code, the English text, and the values in it."""

from dataclasses import dataclass, field
from typing import Final


@dataclass(frozen=True, slots=True)
class Phrase:
    """One sentence.

    Attributes:
        code: stable name by which it is translated; empty: it exists in English only.
        text: the sentence in English, one line.
        values: names, numbers and other sentences in it, by the names that translations know them by.
    """

    code: str
    text: str
    values: "dict[str, str | int | float | Phrase]" = field(default_factory=dict)

    def __str__(self) -> str:
        return self.text


Value = str | int | float | Phrase


def escaped(text: str) -> str:
    r"""A text that can be written as UTF-8: bytes of a file's name that are none stand in it as `\xe5`."""
    if text.isascii():
        return text
    kept = "surrogatepass" if _half_characters(text) else "surrogateescape"
    return text.encode("utf-8", kept).decode("utf-8", "backslashreplace")


def _half_characters(text: str) -> bool:
    """Whether a text holds halves of surrogate pairs that stand for no byte of a name (PEP 383)."""
    return any("\ud800" <= letter <= "\udfff" and not "\udc80" <= letter <= "\udcff" for letter in text)


def phrase(code: str, template: str, /, **values: Value) -> Phrase:
    """A sentence from its English template, as `phrase("disk_full", "{path}: the disk is full", path="/data")`.

    Args:
        code: stable name. It is written out in the call, so that a test finds it.
        template: as for `str.format`; a sentence among the values stands in it as its text.
        values: what the template names, and perhaps more for translations.
    """
    values = {name: escaped(value) if isinstance(value, str) else value for name, value in values.items()}
    return Phrase(code, template.format(**values), values)


def plain(text: str) -> Phrase:
    """A sentence that exists in English only: of a library, of the operating system, of a person."""
    return Phrase("", escaped(text))


#: Where a sentence is wanted and there is nothing to say.
NOTHING: Final = plain("")
