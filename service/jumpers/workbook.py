"""Reads an Excel workbook (.xlsx) as rows of text, within bounds whatever the file holds.

A workbook is a ZIP archive of XML. One of a few kilobytes may unpack to gigabytes, and its XML may have entities that
grow without end. So the parts that are needed are unpacked within bounds and looked at, and only these are parsed.
"""

import io
import re
import unicodedata
import warnings
import zipfile
import zlib
from dataclasses import dataclass
from datetime import date, datetime, time
from typing import Any, Final

from rig.errors import BadInputError
from rig.phrase import phrase

#: What a workbook begins with, and what one of Excel before 2007 does.
MAGIC: Final = b"PK\x03\x04"
OLD_MAGIC: Final = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"
_PARTS_MAX: Final = 1000
#: Bytes, unpacked: of all sheets, of the texts that they share, and of everything else together.
_BYTES_MAX: Final = {"sheets": 8_000_000, "texts": 4_000_000, "rest": 2_000_000}
_ROWS_MAX: Final = 20_000
_CELLS_MAX: Final = 1024
_WORKBOOK: Final = "xl/workbook.xml"
_SHEET: Final = re.compile(r"xl/worksheets/[^/]+\.xml")
_TEXTS: Final = "xl/sharedStrings.xml"
_NEEDED: Final = re.compile(
    r"\[Content_Types\]\.xml|_rels/\.rels|xl/(?:[^/]+\.xml|theme/[^/]+\.xml|_rels/[^/]+\.rels|worksheets/[^/]+\.xml)"
)
_ENCODING: Final = re.compile(rb"""\s*<\?xml[^>]*encoding\s*=\s*["']([^"']*)["']""")
_UTF8: Final = frozenset({b"utf-8", b"us-ascii", b"ascii"})
_FORMULA: Final = re.compile(rb"<(?:\w+:)?f[ >/]")
#: Column and rows of cells that are merged, and as many rows as all of these may have together.
_MERGED: Final = re.compile(rb'<(?:\w+:)?mergeCell\s[^>]*?ref="([A-Z]{1,3})(\d{1,7}):[A-Z]{1,3}(\d{1,7})"')
_MERGED_ROWS_MAX: Final = 100_000
_SAVE: Final = "save the list anew as an Excel workbook (.xlsx), or as CSV UTF-8, and load that"
_ERRORS: Final = frozenset({"#NULL!", "#DIV/0!", "#VALUE!", "#REF!", "#NAME?", "#NUM!", "#N/A"})

#: A row: its number, from 1, and its cells as text.
Row = tuple[int, list[str]]


@dataclass(frozen=True, slots=True)
class Sheet:
    """One visible sheet.

    Attributes:
        rows: that hold something.
    """

    name: str
    rows: tuple[Row, ...]


def sheets_of(content: bytes) -> tuple[Sheet, ...]:
    """The visible sheets of a workbook that hold something, in their order.

    Raises:
        BadInputError: it is no workbook, damaged, encrypted, too large, or holds what a list of names never does.
    """
    parts = _parts(content)
    found = _load(parts, results=True)
    if any(_FORMULA.search(part) for name, part in parts.items() if _SHEET.fullmatch(name)):
        _check_results(found, _load(parts, results=False))
    return tuple(sheet for sheet in found if sheet.rows)


def _parts(content: bytes) -> dict[str, bytes]:
    """The parts that are needed, unpacked, each within the bounds."""
    left = dict(_BYTES_MAX)
    parts: dict[str, bytes] = {}
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            listed = archive.infolist()
            names = {part.filename for part in listed}
            if _WORKBOOK not in names:
                raise BadInputError(
                    phrase("list_archive", "the start list is an archive, but no Excel workbook: " + _SAVE)
                )
            if len(listed) > _PARTS_MAX or len(names) < len(listed):
                raise BadInputError(phrase("list_parts", "the workbook has more parts than a list needs: " + _SAVE))
            for part in listed:
                if _NEEDED.fullmatch(part.filename):
                    kind = (
                        "sheets" if _SHEET.fullmatch(part.filename) else "texts" if part.filename == _TEXTS else "rest"
                    )
                    parts[part.filename] = _unpacked(archive, part, left[kind])
                    left[kind] -= len(parts[part.filename])
    except (zipfile.BadZipFile, zlib.error, RuntimeError, EOFError, OSError, ValueError) as error:
        # RuntimeError: it has a password.
        text = "the workbook cannot be unpacked ({why}): " + _SAVE
        raise BadInputError(phrase("list_packed", text, why=str(error))) from None
    for unpacked in parts.values():
        _check_declarations(unpacked)
    return parts


def _unpacked(archive: zipfile.ZipFile, part: zipfile.ZipInfo, most: int) -> bytes:
    if part.compress_type not in {zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED}:
        raise BadInputError(phrase("list_packing", "the workbook is packed as Excel packs none: " + _SAVE))
    with archive.open(part) as packed:
        # Never without a length: what the archive says of its own sizes may be wrong.
        content = packed.read(most + 1) if part.file_size <= most else b""
    if part.file_size > most or len(content) > most:
        text = "the workbook is too large for a start list: copy the list alone into a new one, and load that"
        raise BadInputError(phrase("list_book_large", text))
    return content


def _check_declarations(part: bytes) -> None:
    """Refuse declarations of entities, and encodings in which they could hide."""
    if b"<!" in part.replace(b"<![CDATA[", b"").replace(b"<!--", b"") or b"\0" in part:
        raise BadInputError(phrase("list_doctype", "the workbook declares what no list needs (DOCTYPE): " + _SAVE))
    declared = _ENCODING.match(part.removeprefix(b"\xef\xbb\xbf")[:200])
    if declared is not None and declared[1].lower() not in _UTF8:
        raise BadInputError(
            phrase("list_book_encoding", "the workbook is in an encoding that Excel does not use: " + _SAVE)
        )


def _archive_of(parts: dict[str, bytes]) -> bytes:
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", zipfile.ZIP_STORED) as archive:
        for name, part in parts.items():
            archive.writestr(name, part)
    return made.getvalue()


def _load(parts: dict[str, bytes], *, results: bool) -> tuple[Sheet, ...]:
    """The visible sheets, with the results of formulas or with the formulas themselves."""
    from openpyxl import load_workbook  # noqa: PLC0415 - takes 0.2 s, which the start of the service need not wait for

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about styles and extensions, of which no list has need
            book = load_workbook(io.BytesIO(_archive_of(parts)), read_only=True, data_only=results, keep_links=False)
            visible = [sheet for sheet in book.worksheets if sheet.sheet_state == "visible"]
            rows = [(sheet, _rows(sheet)) for sheet in visible]
            for sheet, there in rows:  # openpyxl gives who reads rows no merged cells
                _fill_merged(there, parts[sheet._worksheet_path])
            return tuple(Sheet(sheet.title, tuple(there)) for sheet, there in rows)
    except BadInputError:
        raise
    except Exception as error:  # noqa: BLE001 - whatever a damaged part makes of openpyxl
        text = "the workbook cannot be read ({why}): " + _SAVE
        raise BadInputError(phrase("list_book", text, why=f"{type(error).__name__}: {error}")) from None


def _rows(sheet: Any) -> list[Row]:
    sheet.reset_dimensions()  # what the sheet says of its size may be wrong
    rows: list[Row] = []
    for number, cells in enumerate(sheet.iter_rows(values_only=True), start=1):
        if number > _ROWS_MAX or len(cells) > _CELLS_MAX:
            text = (
                'sheet "{sheet}" has more than {rows} rows or {columns} columns: copy the list alone into a '
                "new workbook, and load that"
            )
            raise BadInputError(phrase("list_sheet", text, sheet=sheet.title, rows=_ROWS_MAX, columns=_CELLS_MAX))
        texts = [_text(cell) for cell in cells]
        while texts and not texts[-1]:
            texts.pop()
        if wrong := next((text for text in texts if text in _ERRORS), None):
            text = 'sheet "{sheet}", row {row} holds the error {error}: correct it in the workbook'
            raise BadInputError(phrase("list_cell", text, sheet=sheet.title, row=number, error=wrong))
        if texts:
            rows.append((number, texts))
    return rows


def _fill_merged(rows: list[Row], part: bytes) -> None:
    """Give each row the content of a cell shared with the rows above: Excel keeps that of the first row alone."""
    by_number = dict(rows)
    left = _MERGED_ROWS_MAX
    for column, first, last in _MERGED.findall(part):
        left -= max(0, int(last) - int(first))
        if left < 0:
            merged = "the workbook merges more cells than a list does: undo that, and load it again"
            raise BadInputError(phrase("list_merged", merged))
        place = _place(column)
        above = by_number.get(int(first), [])
        text = above[place] if place < len(above) else ""
        for number in range(int(first) + 1, int(last) + 1) if text else ():
            if (row := by_number.get(number)) is not None:
                row.extend([""] * (place + 1 - len(row)))
                row[place] = text


def _place(column: bytes) -> int:
    """Index of a column by its letters: A is 0, AA 26."""
    place = 0
    for letter in column:
        place = 26 * place + letter - ord("A") + 1
    return place - 1


def _text(cell: object) -> str:
    """A cell as a person reads it."""
    match cell:
        case None:
            return ""
        case float() if cell.is_integer():
            return str(int(cell))
        case datetime():
            return cell.date().isoformat() if cell.time() == time() else cell.isoformat(" ", "minutes")
        case date() | time():
            return cell.isoformat()
        case _:
            return unicodedata.normalize("NFC", " ".join(str(cell).split()))


def _check_results(results: tuple[Sheet, ...], formulas: tuple[Sheet, ...]) -> None:
    """Refuse formulas whose results the workbook does not hold."""
    for shown, written in zip(results, formulas, strict=True):
        known = dict(shown.rows)
        for number, texts in written.rows:
            row = known.get(number, [])
            for place, text in enumerate(texts):
                if text.startswith("=") and not (place < len(row) and row[place]):
                    wrong = (
                        'sheet "{sheet}", row {row} holds a formula without a result: open the workbook in Excel or '
                        "LibreOffice, save it, and load that"
                    )
                    raise BadInputError(phrase("list_formula", wrong, sheet=shown.name, row=number))
