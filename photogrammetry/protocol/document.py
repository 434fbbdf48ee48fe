"""A protocol as data: sections of paragraphs, tables and drawings; and as plain text."""

from collections.abc import Sequence
from dataclasses import dataclass


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
    """A drawing for the page.

    Attributes:
        caption: what it shows.
        svg: the drawing.
        text: what stands in its place in the text; most drawings have nothing there.
    """

    caption: str
    svg: str
    text: tuple[str, ...] = ()


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


def as_text(protocol: Protocol) -> str:
    """The protocol as plain text."""
    lines = [protocol.title, "=" * len(protocol.title)]
    for section in protocol.sections:
        if all(isinstance(part, Drawing) and not part.text for part in section.parts):
            continue
        lines += ["", section.title, "-" * len(section.title)]
        for part in section.parts:
            if isinstance(part, str):
                lines.append(part)
            else:
                lines += _text_table(part) if isinstance(part, Table) else part.text
    return "\n".join(lines) + "\n"


def _text_table(table: Table) -> list[str]:
    rows = [table.head, *table.rows]
    widths = [max(len(row[column]) for row in rows) for column in range(len(table.head))]
    return ["  " + "  ".join(_padded(row, widths)).rstrip() for row in rows]


def _padded(row: Sequence[str], widths: Sequence[int]) -> list[str]:
    first = row[0].ljust(widths[0])
    return [first, *(cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True))]
