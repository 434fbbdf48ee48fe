"""Names in every encoding that programs write lists in: read right, or shown to be chosen, or refused; never wrong."""

import codecs
import itertools
import unicodedata

import pytest

from rig.errors import BadInputError
from service.jumpers.table import read_table, readings_of

NAMES = (
    "Åse Bjørk", "Anna Øverbø", "Pål Kåre Ødegård", "Kjærsti Ærø", "Jörg Jäger", "Björn Öberg", "Åke Ängström",
    "Renée Müller",
    "ANDRÉ PÅL", "ÅSE BJØRK", "Äkäslompolo", "José Muñoz", "Anže Lanišek", "Žiga Šink", "Zoë Brânc", "Noël",
    "d\N{RIGHT SINGLE QUOTATION MARK}Åbo", "Lag «Ås»", "«Øystein", "Bodø \N{EN DASH} Ås", "Weiß", "Ödön",
    "Ég", "ålesund il",
)  # fmt: skip
#: Encodings of one byte. DOS programs wrote 850 in Europe and 865 in Norway, whose letters are the same.
ONE_BYTE = ("latin-1", "cp1252", "mac-roman", "cp850", "cp865")


def _has(encoding: str, text: str) -> bool:
    """Whether an encoding has all letters of a text."""
    return text.encode(encoding, errors="replace").decode(encoding) == text


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize(
    ("encoding", "mark"),
    [
        ("utf-8", b""), ("utf-8", codecs.BOM_UTF8), ("utf-16-le", b""), ("utf-16-le", codecs.BOM_UTF16_LE),
        ("utf-16-be", b""), ("utf-16-be", codecs.BOM_UTF16_BE), ("utf-32-le", codecs.BOM_UTF32_LE),
    ],
)  # fmt: skip
def test_unicode_is_certain(name: str, encoding: str, mark: bytes) -> None:
    found = read_table(mark + f"Startnr;Navn\r\n7;{name}\r\n".encode(encoding))
    assert [line.athlete for line in found.lines] == [name]


@pytest.mark.parametrize(("name", "encoding"), [(n, e) for n in NAMES for e in ONE_BYTE if _has(e, n)])
def test_one_name_alone_is_read_right_or_shown_to_be_chosen(name: str, encoding: str) -> None:
    content = f"Startnr;Navn\r\n7;{name}\r\n".encode(encoding)
    found = [reading.table.lines[0].athlete for reading in readings_of(content) if reading.table is not None]
    assert name in found
    if len(found) > 1:
        with pytest.raises(BadInputError, match="can be read in several ways"):
            read_table(content)


@pytest.mark.parametrize("encoding", ONE_BYTE)
def test_any_two_names_are_never_read_wrong(encoding: str) -> None:
    certain = 0
    for names in itertools.combinations((name for name in NAMES if _has(encoding, name)), 2):
        content = ("bib\tathlete\n" + "".join(f"{n}\t{name}\n" for n, name in enumerate(names))).encode(encoding)
        found = [[line.athlete for line in each.table.lines] for each in readings_of(content) if each.table is not None]
        assert list(names) in found
        certain += len(found) == 1
    assert certain > 20


def test_a_list_as_norwegian_clubs_have_them_needs_no_question() -> None:
    text = "Startnr;Navn;Klubb\n1;Pål Kåre Ødegård;Bærum\n2;Jørgen Ås;Trønder-Lyn\n3;Kjærsti Berg;Røros\n"
    for encoding in ("latin-1", "cp1252", "mac-roman"):
        assert read_table(text.encode(encoding)).lines == read_table(text.encode()).lines, encoding


def test_where_letters_differ_a_person_chooses() -> None:
    content = "bib;athlete\n1;Anže Lanišek\n".encode("cp1252")
    with pytest.raises(BadInputError, match=r"\(windows-1252, mac-roman.*give the `encoding`"):
        read_table(content)
    assert read_table(content, "windows-1252").lines[0].athlete == "Anže Lanišek"
    with pytest.raises(BadInputError, match="there is utf-8"):
        read_table(content, "klingon")
    with pytest.raises(BadInputError, match="no text in utf-8"):
        read_table(content, "utf-8")


def test_letters_above_the_heading_ask_nothing() -> None:
    content = "Jägerrennen 2026\nbib;athlete\n1;Ola\n".encode("cp1252")
    assert [line.athlete for line in read_table(content).lines] == ["Ola"]


@pytest.mark.parametrize(
    "content",
    [
        b"bib;athlete\n1;P\xc3\xa5l\n2;K\xc3\n",  # UTF-8 that is cut off
        bytes(range(256)),
        b"bib;athlete\n1;\x00\x01\x02\n",
        b"\xff\xfeb\x00i\x00b",  # an odd byte
        b"%PDF-1.7 \xe2\xe3\xcf\xd3",
    ],
)
def test_what_is_no_text_is_refused_with_what_to_do(content: bytes) -> None:
    with pytest.raises(BadInputError, match=r"save it as \"CSV UTF-8\""):
        read_table(content)


def test_unicode_of_other_scripts_and_of_macs_is_certain() -> None:
    content = unicodedata.normalize("NFD", "bib;athlete\n1;Åse Bjørk\n2;Евгений Климов\n3;小林陵侑\n4;Țepeș\n").encode()
    found = [line.athlete for line in read_table(content).lines]
    assert found == ["Åse Bjørk", "Евгений Климов", "小林陵侑", "Țepeș"]
