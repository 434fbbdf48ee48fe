"""Start lists as spreadsheets and competition programs write them, and what is said of those that are wrong."""

import re

import pytest

from rig.errors import BadInputError
from service.jumpers.table import read_table

ROWS = [("17", "Anna Øverbø", "12", "Lyn"), ("18", "Åse Bjørk", "", "Koll")]


@pytest.mark.parametrize("separator", [";", ",", "\t"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1", "cp1252", "utf-16"])
@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_whatever_wrote_it_the_names_are_right(separator: str, encoding: str, newline: str) -> None:
    text = newline.join(separator.join(row) for row in [("Bib", "Athlete", "Gate", "Club"), *ROWS, ("", "", "", "")])
    found = read_table(text.encode(encoding))
    assert [(each.bib, each.athlete, each.gate, each.club) for each in found.lines] == ROWS
    assert found.columns == ()


def test_norwegian_names_any_order_and_own_columns() -> None:
    content = (
        'sep=;\r\nKlasse;Etternavn;Fornavn;Start nr.;Klubb;\r\nJ18;"Berg; d.y.";"Anna ""A""";7;Lyn;\r\n;Dahl;Åse;8\r\n'
    )
    found = read_table(content.encode())
    assert found.columns == ("Klasse",)
    assert [(each.bib, each.athlete, each.club, each.more) for each in found.lines] == [
        ("7", 'Anna "A" Berg; d.y.', "Lyn", {"Klasse": "J18"}),
        ("8", "Åse Dahl", "", {}),
    ]


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (
            "17;Anna;12\n18;Berit;12\n",
            'no line names a column "bib" or "athlete"; the first one has "17", "Anna", "12"',
        ),
        ("bib;athlete;Name\n1;A;B\n", 'column "athlete" is there twice in "bib", "athlete", "Name"'),
        ("bib;athlete;session\n1;A;B\n", 'column "session" has a name that every jump uses'),
        ("bib;athlete\n1;A\n\n2;B;C\n", "line 4 has 3 fields, and the heading names 2 columns"),
        ("bib;athlete;\n1;A;x\n", 'line 2 has "x" in a column without a name'),
        ("bib;athlete\n7;A\n8;B\n7;C\n", "bib 7 stands in lines 2 and 4"),
        (f"bib;athlete\n1;{'x' * 300}\n", "line 2, column athlete: more than 200 letters; shorten it"),
        ("bib;athlete\n1;A\x07B\n", "line 2, column athlete: holds letters that nobody sees"),
        ("bib;athlete\n" + "".join(f"{n};x\n" for n in range(2100)), "2100 jumpers: 2000 at most"),
        ("bib;" + ";".join(f"c{n}" for n in range(20)) + "\n", "20 own columns: 12 at most"),
        (";;\n", "the start list is empty"),
        ("PK\x03\x04\0\0", "the workbook cannot be unpacked"),
    ],
)
def test_what_is_wrong_is_named(content: str, said: str) -> None:
    with pytest.raises(BadInputError, match=re.escape(said)) as refused:
        read_table(content.encode())
    assert "\n" not in str(refused.value)
    assert ": " in str(refused.value) or "; " in str(refused.value)
