"""Which letters the bytes of a table stand for: told by marks and by what makes words, never guessed.

UTF-8 with letters beyond ASCII proves itself. In the encodings of one byte (Windows, which Latin-1 is part of, Mac
Roman, DOS) any bytes are text, and only the words tell which one it is: letters of European names, capitals in place.
Where more than one makes words, a person has to look, and none is taken.
"""

import codecs
import unicodedata
from contextlib import suppress
from dataclasses import dataclass
from typing import Final

from rig.errors import BadInputError
from rig.phrase import phrase

#: Encodings that a caller may name: Windows (with Latin-1), Mac Roman, DOS, and those that prove themselves.
ONE_BYTE: Final = ("windows-1252", "mac-roman", "cp850")
ENCODINGS: Final = ("utf-8", "utf-16-le", "utf-16-be", *ONE_BYTE)
_MARKS: Final = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF32_LE, "utf-32-le"),  # begins as UTF-16 does
    (codecs.BOM_UTF32_BE, "utf-32-be"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)
#: Letters of European names beyond ASCII that these encodings have.
_LETTERS: Final = frozenset("ÀÁÂÃÄÅÆÇÈÉÊËÌÍÎÏÐÑÒÓÔÕÖØÙÚÛÜÝÞßàáâãäåæçèéêëìíîïðñòóôõöøùúûüýþÿŒœŠšŽžŸ")
_APOSTROPHE: Final = "\N{RIGHT SINGLE QUOTATION MARK}"
#: Signs that stand before words, after them, or inside; and those that stand alone.
_BEFORE, _AFTER, _INSIDE = (
    frozenset("«“\N{LEFT SINGLE QUOTATION MARK}"),
    frozenset("»”…°" + _APOSTROPHE),
    frozenset(_APOSTROPHE),
)
_ALONE: Final = frozenset("\N{EN DASH}—\xa0§€")
#: Latin letters that few names have, with signs of phonetics; and those of them that Romanian has.
_RARE, _ROMANIAN = ("\u0180", "\u02ff"), frozenset("ȘșȚț")
_SAVE: Final = 'save it as "CSV UTF-8", or as an Excel workbook (.xlsx), and load that'


@dataclass(frozen=True, slots=True)
class Text:
    """What bytes may say.

    Attributes:
        encoding: one of `ENCODINGS`, or UTF-32.
        text: what they say in it.
    """

    encoding: str
    text: str


def texts_of(content: bytes, encoding: str | None = None) -> tuple[Text, ...]:
    """What the bytes of a table may say: one text if that is certain, several if a person has to look.

    Args:
        content: the bytes.
        encoding: as a person has said; None: nobody has.

    Raises:
        BadInputError: they are no text, or no encoding makes words of them.
    """
    if encoding is not None:
        if encoding not in ENCODINGS:
            known = "encoding {encoding}: there is {encodings}; name one of these"
            raise BadInputError(phrase("list_encoding", known, encoding=encoding, encodings=", ".join(ENCODINGS)))
        return (Text(encoding, _decoded(content, encoding)),)
    for mark, marked in _MARKS:
        if content.startswith(mark):
            return (Text(marked, _decoded(content, marked)),)
    if b"\0" in content:
        return (_without_mark(content),)
    unicode: tuple[Text, ...] = ()
    with suppress(UnicodeDecodeError):  # then each letter is one byte
        unicode = (Text("utf-8", _composed(content.decode("utf-8"))),)
    if unicode and not _is_doubtful(unicode[0].text):
        return unicode
    found = unicode + tuple(text for each in ONE_BYTE if (text := _words(content, each)) is not None)
    if not found:
        unknown = "letters of the start list cannot be told (æ, ø, å, é …): " + _SAVE
        raise BadInputError(phrase("list_letters_unknown", unknown))
    return found


def _decoded(content: bytes, encoding: str) -> str:
    """The text in an encoding, without a mark before it.

    Raises:
        BadInputError: it is none.
    """
    try:
        text = content.decode(encoding).removeprefix("\ufeff")
    except UnicodeDecodeError:
        wrong = "the start list is no text in {encoding}: " + _SAVE
        raise BadInputError(phrase("list_other_encoding", wrong, encoding=encoding)) from None
    if "\0" in text:
        raise BadInputError(phrase("list_no_text", "the start list is no text: " + _SAVE))
    return _composed(text)


def _composed(text: str) -> str:
    """The text with each letter and its accent as one character, as Macs do not write them."""
    return unicodedata.normalize("NFC", text)


def _is_doubtful(text: str) -> bool:
    """Whether UTF-8 makes letters of it that hardly stand beside each other: two of another encoding by chance.

    Only capitals and signs followed by certain others do that, such as an apostrophe and Å in Mac Roman.
    """
    before = ""
    for each in text:
        script = "LATIN" if each.isascii() and each.isalpha() else ""
        if not each.isascii() and unicodedata.category(each)[0] in "LM":
            script = unicodedata.name(each, "").partition(" ")[0]
            if script == "COMBINING":
                continue
            if _RARE[0] <= each <= _RARE[1] and each not in _ROMANIAN:
                return True
        if script and before and script != before:
            return True
        before = script
    return False


def _without_mark(content: bytes) -> Text:
    """Text in UTF-16 without a mark: separators and line ends are ASCII, whose other half is zero."""
    found = []
    for encoding in ("utf-16-le", "utf-16-be"):
        try:
            text = _decoded(content, encoding)
        except BadInputError:
            continue
        if any(each in text for each in ";,\t\n") and all(each.isprintable() or each in "\t\r\n" for each in text):
            found.append(Text(encoding, text))
    if len(found) != 1:
        raise BadInputError(phrase("list_no_text", "the start list is no text: " + _SAVE))
    return found[0]


def _words(content: bytes, encoding: str) -> Text | None:
    """The text in a one-byte encoding; None if its letters make no words."""
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError:
        return None
    around = f" {text} "
    triples = zip(around, around[1:], around[2:], strict=False)
    return (
        Text(encoding, text) if all(each.isascii() or _fits(*seen) for seen in triples if (each := seen[1])) else None
    )


def _fits(before: str, each: str, after: str) -> bool:
    """Whether a character beyond ASCII stands where it can: no capital behind a small letter, no sign amid letters."""
    if each in _LETTERS:
        small_before_capital = before.isalpha() and before.islower() and each.isupper()
        return not small_before_capital and not _amid_capitals(before, each, after)
    joined = before.isalpha(), after.isalpha()
    if joined == (True, True):
        return each in _INSIDE
    if each in _BEFORE:
        return not joined[0]
    if each in _AFTER:
        return not joined[1]
    return each in _ALONE


def _amid_capitals(before: str, each: str, after: str) -> bool:
    """Whether a small letter stands between two capitals; ß has no other form."""
    return each.islower() and each not in "ßÿ" and before.isupper() and after.isupper()
