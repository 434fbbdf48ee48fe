"""Start lists out of Excel workbooks: as people make them, and as somebody makes them who means harm."""

import io
import time
import tracemalloc
import zipfile
from datetime import date
from pathlib import Path

import openpyxl
import pytest

from rig.errors import BadInputError
from service.jumpers.table import Table, read_table, readings_of

SHEET = "xl/worksheets/sheet1.xml"


def book(*sheets: tuple[str, list[list[object]]]) -> bytes:
    """A workbook with these sheets."""
    made = openpyxl.Workbook()
    made.remove(made.worksheets[0])
    for title, rows in sheets:
        sheet = made.create_sheet(title)
        for row in rows:
            sheet.append(row)
    return saved(made)


def saved(made: openpyxl.Workbook) -> bytes:
    """Its bytes."""
    out = io.BytesIO()
    made.save(out)
    return out.getvalue()


def with_part(content: bytes, name: str, part: bytes, method: int = zipfile.ZIP_DEFLATED) -> bytes:
    """The workbook with another content of one part."""
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as before, zipfile.ZipFile(out, "w", method) as after:
        for each in before.namelist():
            if each != name:
                after.writestr(each, before.read(each))
        after.writestr(name, part)
    return out.getvalue()


ROWS: list[list[object]] = [
    ["Startnr", "Navn", "Bom", "Klubb", "Født"],
    [1, "Åse Bjørk", 12.0, "Lyn", date(2009, 3, 1)],
]


def test_a_list_as_excel_has_it() -> None:
    """A merged title, an empty row, numbers with a fraction of nothing, a date, formatted rows below."""
    made = openpyxl.Workbook()
    sheet = made.active
    sheet["A1"] = "Startliste Granåsen, 12. januar"
    sheet.merge_cells("A1:E1")
    for row in (
        [],
        *ROWS,
        [],
        [2.0, "Jörg Jäger", "11.5", None, None],
        [None, None, None],
        ["007", "Zoë", 3, " \n", ""],
    ):
        sheet.append(row)
    sheet["A40"].font = openpyxl.styles.Font(bold=True)
    found = read_table(saved(made))
    assert found.heading == 3
    assert found.columns == ("Født",)
    assert [(each.bib, each.athlete, each.gate, each.club, each.more.get("Født", "")) for each in found.lines] == [
        ("1", "Åse Bjørk", "12", "Lyn", "2009-03-01"), ("2", "Jörg Jäger", "11.5", "", ""), ("007", "Zoë", "3", "", ""),
    ]  # fmt: skip


def test_a_club_that_stands_once_for_several_jumpers_is_that_of_all() -> None:
    made = openpyxl.Workbook()
    sheet = made.active
    for row in ([None, "bib", "athlete", "club"], [None, 1, "Åse", "Lyn"], [None, 2, "Eva"], [None, 3, "Ida", "Koll"]):
        sheet.append(row)
    sheet.merge_cells("D2:D3")
    sheet.merge_cells("D4:D9")
    content = saved(made)
    assert [line.club for line in read_table(content).lines] == ["Lyn", "Lyn", "Koll"]
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        many = archive.read(SHEET).replace(b"D4:D9", b"D4:D1048576")
    with pytest.raises(BadInputError, match="merges more cells than a list does"):
        read_table(with_part(content, SHEET, many))


def test_the_sheet_with_the_heading_is_taken_and_of_several_one_is_chosen() -> None:
    other: list[list[object]] = [["Program"], ["10:00", "Prøveomgang"]]
    found = readings_of(book(("Program", other), ("Liste", ROWS), ("Tom", [])))
    assert [(each.sheet, each.table is not None) for each in found] == [("Liste", True)]
    several = book(("Gutter", ROWS), ("Jenter", [["bib", "athlete"], [5, "Eva"]]), ("Program", other))
    with pytest.raises(BadInputError, match=r"several sheets hold a list \(Gutter, Jenter\): say which `sheet`"):
        read_table(several)
    assert read_table(several, sheet="Jenter").lines[0].athlete == "Eva"
    with pytest.raises(BadInputError, match='no sheet "Damer"'):
        read_table(several, sheet="Damer")
    hidden = openpyxl.load_workbook(io.BytesIO(several))
    hidden["Jenter"].sheet_state = "hidden"
    assert read_table(saved(hidden)).lines[0].athlete == "Åse Bjørk"


def test_two_thousand_jumpers_take_a_moment() -> None:
    rows: list[list[object]] = [[n, f"Åse Bjørk {n}", 12, "Lyn", date(2009, 3, 1)] for n in range(1, 2001)]
    content = book(("Liste", [ROWS[0], *rows]))
    began = time.process_time()
    found: Table = read_table(content)
    assert len(found.lines) == 2000
    assert time.process_time() - began < 5  # CPU; some 0.5 s here
    text = "bib;athlete\n" + "".join(f"{n};Åse {n}\n" for n in range(2000))
    assert len(read_table(text.encode("latin-1")).lines) == 2000


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        ([["Program"], ["10:00", "Prøve"]], 'no line names a column "bib" or "athlete"; the first one has "Program"'),
        ([["bib", "athlete"], [date(2026, 1, 12), "Eva"]], "the bib 2026-01-12 is a date"),
        ([["bib", "athlete"], [1, "#REF!"]], "row 2 holds the error #REF!"),
        ([["bib", "athlete"], ["=A1", "Eva"]], "row 2 holds a formula without a result"),
        ([["bib", "athlete"], [7, "A"], [7.0, "B"]], "bib 7 stands in lines 2 and 3"),
        ([], "the workbook is empty"),
    ],
)
def test_what_is_wrong_in_a_workbook_is_named(rows: list[list[object]], said: str) -> None:
    with pytest.raises(BadInputError) as refused:
        read_table(book(("Liste", rows)))
    assert said in str(refused.value)


def _bomb() -> bytes:
    return with_part(book(("a", ROWS)), SHEET, b"<x>" + b" " * 60_000_000)


def _lying_bomb() -> bytes:
    """Its directory says that the sheet is small; unpacked it is not."""
    content = bytearray(_bomb())
    for place in range(len(content) - 4):
        if content[place : place + 4] == (60_000_003).to_bytes(4, "little"):
            content[place : place + 4] = (1000).to_bytes(4, "little")
    return bytes(content)


def _entities() -> bytes:
    laughs = b"".join(b'<!ENTITY l%d "%s">' % (n, b"&l%d;" % (n - 1) * 10) for n in range(1, 10))
    text = b'<?xml version="1.0"?><!DOCTYPE x [<!ENTITY l0 "ha">' + laughs + b"]><x>&l9;</x>"
    return with_part(book(("a", ROWS)), "xl/workbook.xml", text)


def _far_cell() -> bytes:
    rows = b'<row r="1"><c r="A1" t="inlineStr"><is><t>bib</t></is></c></row>'
    rows += b'<row r="1048576"><c r="A1048576"><v>1</v></c></row>'
    head = b'<worksheet xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"><sheetData>'
    return with_part(book(("a", ROWS)), SHEET, head + rows + b"</sheetData></worksheet>")


def _many_parts() -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for n in range(5000):
            archive.writestr(f"xl/worksheets/sheet{n}.xml", b"")
        archive.writestr("xl/workbook.xml", b"<x/>")
    return out.getvalue()


def _utf16_entities() -> bytes:
    return with_part(
        book(("a", ROWS)), "xl/workbook.xml", '<?xml version="1.0" encoding="utf-16"?><!DOCTYPE x><x/>'.encode("utf-16")
    )


HOSTILE = {
    "zip bomb": (_bomb, "too large for a start list"),
    "zip bomb that lies": (_lying_bomb, "workbook"),
    "entities": (_entities, "declares what no list needs"),
    "entities in utf-16": (_utf16_entities, "declares what no list needs"),
    "other packing": (
        lambda: with_part(book(("a", ROWS)), SHEET, b"x" * 10**6, zipfile.ZIP_BZIP2),
        "as Excel packs none",
    ),
    "cell far below": (_far_cell, "more than 20000 rows"),
    "many parts": (_many_parts, "more parts than a list needs"),
    "no workbook": (lambda: with_part(book(("a", ROWS)), "x", b"")[:200], "cannot be unpacked"),
    "damaged": (lambda: book(("a", ROWS))[:-500], "cannot be unpacked"),
    "broken xml": (lambda: with_part(book(("a", ROWS)), SHEET, b"<worksheet><row"), "cannot be read"),
    "old excel": (lambda: b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(500), "an old Excel (.xls): save it as .xlsx"),
}


@pytest.mark.parametrize("kind", HOSTILE)
def test_what_means_harm_is_refused_soon_and_small(kind: str) -> None:
    make, said = HOSTILE[kind]
    content = make()
    began = time.process_time()
    tracemalloc.start()
    try:
        with pytest.raises(BadInputError) as refused:
            read_table(content)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)
    assert time.process_time() - began < 5
    assert peak < 60e6


def test_an_archive_of_another_program_is_no_workbook(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "list.ods", "w") as archive:
        archive.writestr("mimetype", "application/vnd.oasis.opendocument.spreadsheet")
    with pytest.raises(BadInputError, match=r"no Excel workbook: save the list anew as an Excel workbook \(.xlsx\)"):
        read_table((tmp_path / "list.ods").read_bytes())
