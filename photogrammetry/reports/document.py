"""A report as data (sections of paragraphs, tables and drawings), as plain text, and as one HTML page.

The page needs no other file. It is made for light and dark screens, phones and paper.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from itertools import groupby
from pathlib import Path

_LIGHT = (
    "--paper:#fff;--ink:#1c2227;--soft:#5d6871;--faint:#dde2e6;--fill:#f3f5f7;"
    "--blue:#1a66b0;--red:#c2321f;--green:#23803c;--amber:#b26a00"
)
_DARK = (
    "--paper:#15191d;--ink:#e6eaed;--soft:#9ba7b1;--faint:#333b43;--fill:#1e242a;"
    "--blue:#6cb2f5;--red:#ff8070;--green:#63c583;--amber:#e5ab45"
)
_STYLE = f"""
:root{{color-scheme:light dark;{_LIGHT}}}
@media screen and (prefers-color-scheme:dark){{:root{{{_DARK}}}}}
*{{box-sizing:border-box}}
body{{font:16px/1.5 system-ui,sans-serif;background:var(--paper);color:var(--ink);max-width:74rem;margin:auto;\
padding:1rem;overflow-wrap:break-word}}
fieldset{{float:right;border:0;margin:0;padding:0}}
fieldset label{{display:inline-block;margin-left:.6rem;padding:.75rem .2rem}}
:root:has(#in-nb:checked) body [lang=en],:root:has(#in-en:checked) body [lang=nb]{{display:none}}
h1{{font-size:1.6rem;line-height:1.2;margin:.5rem 0 1.5rem}}
h2{{font-size:1.2rem;margin:2.2rem 0 .6rem;padding-bottom:.2rem;border-bottom:2px solid var(--faint)}}
p{{margin:.4rem 0;max-width:62rem}}
.table{{overflow-x:auto;margin:.8rem 0;background:\
linear-gradient(90deg,var(--paper) 50%,transparent) 0 0/2rem 100% no-repeat local,\
linear-gradient(-90deg,var(--paper) 50%,transparent) 100% 0/2rem 100% no-repeat local,\
linear-gradient(90deg,var(--faint),transparent) 0 0/.8rem 100% no-repeat,\
linear-gradient(-90deg,var(--faint),transparent) 100% 0/.8rem 100% no-repeat}}
table{{border-collapse:collapse;font-size:.9rem;font-variant-numeric:tabular-nums}}
th,td{{padding:.2rem .7rem;text-align:right;white-space:nowrap;border-bottom:1px solid var(--faint)}}
th{{color:var(--soft);font-weight:600}}
th:first-child,td:first-child{{text-align:left;padding-left:0}}
@media(max-width:40rem){{table{{font-size:.8rem}}th,td{{padding:.2rem .35rem}}\
th:first-child,td:first-child{{position:sticky;left:0;background:var(--paper)}}}}
.drawings{{display:grid;grid-template-columns:repeat(auto-fill,minmax(min(100%,22rem),1fr));gap:1.2rem;margin:1rem 0}}
figure{{margin:0;min-width:0;break-inside:avoid}}
figcaption{{color:var(--soft);font-size:.85rem;line-height:1.35;margin-top:.3rem}}
svg{{display:block;width:100%;height:auto;background:var(--fill);border-radius:.3rem;fill:currentColor;stroke:none}}
svg text{{font:10px system-ui,sans-serif;fill:var(--soft)}}
svg line,svg polyline,svg ellipse,svg circle[fill=none]{{stroke:currentColor}}
{"".join(f".{name}{{color:var(--{name})}}" for name in ("ink", "soft", "faint", "blue", "red", "green", "amber"))}
@page{{size:A4;margin:12mm}}
@media print{{:root{{font-size:10pt}}body{{font-size:10pt;max-width:none;padding:0}}table{{font-size:.75rem}}\
th,td{{padding:.1rem .25rem}}.table{{overflow:visible}}tr{{break-inside:avoid}}\
h2{{break-after:avoid}}.drawings{{grid-template-columns:1fr 1fr}}svg{{border:1px solid var(--faint)}}\
fieldset{{display:none}}}}
"""


_CHOICE = (
    '<fieldset aria-label="Language / Språk"><label><input type="radio" name="language" id="in-en" checked> English'
    '</label><label><input type="radio" name="language" id="in-nb"> Norsk</label></fieldset>'
    '<script>document.getElementById(/^(nb|nn|no)\\b/i.test(navigator.language) ? "in-nb" : "in-en").checked = true'
    "</script>"
)


@dataclass(frozen=True, slots=True)
class Table:
    """A table; its numbers are formatted already.

    Attributes:
        head: names of the columns.
        rows: each with as many cells as the head.
    """

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True, slots=True)
class Drawing:
    """A drawing for the page.

    Attributes:
        caption: what it shows.
        svg: the drawing.
        text: lines that replace it in plain text; most drawings have none.
    """

    caption: str
    svg: str
    text: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Section:
    """A section of a report."""

    title: str
    parts: tuple[str | Table | Drawing, ...]


@dataclass(frozen=True, slots=True)
class Report:
    """A whole report."""

    title: str
    sections: tuple[Section, ...]


def as_text(report: Report) -> str:
    """The report as plain text."""
    lines = [report.title, "=" * len(report.title)]
    for section in report.sections:
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


def write_report(report: Report, folder: Path, norwegian: Report | None = None) -> tuple[Path, Path]:
    """Write `protocol.txt` and `protocol.html` into a folder, which is created if it does not exist.

    Args:
        report: what to write.
        folder: where.
        norwegian: the same, for the page; see `as_html`.

    Raises:
        OSError: the folder cannot be written to.
    """
    folder.mkdir(parents=True, exist_ok=True)
    text, page = folder / "protocol.txt", folder / "protocol.html"
    text.write_text(as_text(report), encoding="utf-8")
    page.write_text(as_html(report, norwegian), encoding="utf-8")
    return text, page


def as_html(report: Report, norwegian: Report | None = None) -> str:
    """The report as one page.

    Args:
        report: what to show.
        norwegian: the same in Norwegian, part by part; the page holds both, and shows the one that its reader chooses.
    """
    other = norwegian or report
    body = [
        *([] if norwegian is None else [_CHOICE]),
        f"<h1>{_both(report.title, other.title)}</h1>",
        *(line for pair in zip(report.sections, other.sections, strict=True) for line in _section(*pair)),
    ]
    head = (
        '<meta charset="utf-8"><meta name="viewport" content="width=device-width,initial-scale=1">'
        f"<title>{escape(report.title)}</title><style>{_STYLE}</style>"
    )
    return f'<!doctype html>\n<html lang="en"><head>{head}</head>\n<body>\n' + "\n".join(body) + "\n</body></html>\n"


def _both(english: str, norwegian: str) -> str:
    """A text in both languages, where they differ."""
    if english == norwegian:
        return escape(english)
    return f'<span lang="en">{escape(english)}</span><span lang="nb">{escape(norwegian)}</span>'


def _section(section: Section, other: Section) -> list[str]:
    """The lines of a section; successive drawings form a grid."""
    lines = [f"<h2>{_both(section.title, other.title)}</h2>"]
    pairs = zip(section.parts, other.parts, strict=True)
    for drawn, parts in groupby(pairs, lambda pair: isinstance(pair[0], Drawing)):
        lines += ['<div class="drawings">'] if drawn else []
        lines += [_part(*pair) for pair in parts]
        lines += ["</div>"] if drawn else []
    return lines


def _part(part: str | Table | Drawing, other: str | Table | Drawing) -> str:
    if isinstance(part, Drawing) and isinstance(other, Drawing):
        return f"<figure>{part.svg}<figcaption>{_both(part.caption, other.caption)}</figcaption></figure>"
    if isinstance(part, Table) and isinstance(other, Table):
        head, *rows = (
            [_both(*cells) for cells in zip(*pair, strict=True)]
            for pair in zip((part.head, *part.rows), (other.head, *other.rows), strict=True)
        )
        heads = "".join(f"<th>{cell}</th>" for cell in head)
        lines = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in rows)
        # a wide table scrolls within its box, also by keyboard; a shade at its edge shows that there is more
        table = f"<table><thead><tr>{heads}</tr></thead><tbody>{lines}</tbody></table>"
        return f'<div class="table" tabindex="0">{table}</div>'
    return f"<p>{_both(str(part), str(other))}</p>"
