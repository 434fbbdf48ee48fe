"""A protocol as data: sections of paragraphs, tables and drawings, rendered as text and as HTML."""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

_STYLE = (
    "body{font:15px/1.45 sans-serif;max-width:64em;margin:2em auto;padding:0 1em;color:#222}"
    "table{border-collapse:collapse;margin:.7em 0}td,th{padding:.15em .7em;border-bottom:1px solid #ddd;"
    "text-align:right;font-variant-numeric:tabular-nums}td:first-child,th:first-child{text-align:left}"
    "svg{max-width:100%;height:auto;border:1px solid #ddd}h2{margin-top:1.8em}"
)


@dataclass(frozen=True, slots=True)
class Table:
    """A table of words and numbers already in words.

    Attributes:
        head: names of the columns.
        rows: as many cells as the head.
    """

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True, slots=True)
class Drawing:
    """A drawing for the page: SVG and a caption."""

    caption: str
    svg: str


@dataclass(frozen=True, slots=True)
class Section:
    """A section of a protocol."""

    title: str
    parts: tuple[str | Table | Drawing, ...]


@dataclass(frozen=True, slots=True)
class Protocol:
    """A protocol."""

    title: str
    sections: tuple[Section, ...]


def write_protocol(protocol: Protocol, folder: Path) -> tuple[Path, Path]:
    """Write `protocol.txt` and `protocol.html` into a folder, which is made if need be.

    Raises:
        OSError: the folder cannot be written to.
    """
    folder.mkdir(parents=True, exist_ok=True)
    text, page = folder / "protocol.txt", folder / "protocol.html"
    text.write_text(as_text(protocol), encoding="utf-8")
    page.write_text(as_html(protocol), encoding="utf-8")
    return text, page


def as_text(protocol: Protocol) -> str:
    """The protocol as plain text; drawings stand in the page alone."""
    lines = [protocol.title, "=" * len(protocol.title)]
    for section in protocol.sections:
        if all(isinstance(part, Drawing) for part in section.parts):
            continue
        lines += ["", section.title, "-" * len(section.title)]
        for part in section.parts:
            if isinstance(part, str):
                lines.append(part)
            elif isinstance(part, Table):
                lines += _text_table(part)
    return "\n".join(lines) + "\n"


def as_html(protocol: Protocol) -> str:
    """The protocol as one page that needs nothing else."""
    body = [f"<h1>{escape(protocol.title)}</h1>"]
    for section in protocol.sections:
        body.append(f"<h2>{escape(section.title)}</h2>")
        for part in section.parts:
            if isinstance(part, str):
                body.append(f"<p>{escape(part)}</p>")
            elif isinstance(part, Table):
                body.append(_html_table(part))
            else:
                body.append(f"<figure>{part.svg}<figcaption>{escape(part.caption)}</figcaption></figure>")
    head = f'<meta charset="utf-8"><title>{escape(protocol.title)}</title><style>{_STYLE}</style>'
    return f'<!doctype html>\n<html lang="en"><head>{head}</head>\n<body>\n' + "\n".join(body) + "\n</body></html>\n"


def _text_table(table: Table) -> list[str]:
    rows = [table.head, *table.rows]
    widths = [max(len(row[column]) for row in rows) for column in range(len(table.head))]
    return ["  " + "  ".join(_padded(row, widths)).rstrip() for row in rows]


def _padded(row: Sequence[str], widths: Sequence[int]) -> list[str]:
    first = row[0].ljust(widths[0])
    return [first, *(cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True))]


def _html_table(table: Table) -> str:
    head = "".join(f"<th>{escape(cell)}</th>" for cell in table.head)
    rows = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in table.rows)
    return f"<table><tr>{head}</tr>{rows}</table>"
