"""Writes PDF pages of black rectangles, discs, lines and words at exact places: all that a printed target needs.

Places are millimetres from the page's top left corner. PDF counts points (1/72 inch) from the bottom left.
"""

from collections.abc import Sequence
from typing import Final

_POINT_MM: Final = 25.4 / 72.0
#: How far a quarter circle's control points are from its ends, in radii.
_QUARTER: Final = 4.0 / 3.0 * (2.0**0.5 - 1.0)
#: Viewers are asked not to shrink pages to the printer's margins.
_CATALOG: Final = "<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>"
_FONT: Final = "<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica /Encoding /WinAnsiEncoding >>"


class Page:
    """One page; sizes in mm."""

    def __init__(self, width: float, height: float) -> None:
        self.width, self.height = width, height
        self._parts: list[str] = []

    def box(self, x: float, y: float, width: float, height: float) -> None:
        """A black rectangle; x, y of its top left corner."""
        self._parts.append(f"{self._at(x, y + height)} {_points(width)} {_points(height)} re f")

    def disc(self, x: float, y: float, radius: float) -> None:
        """A black disc about x, y: four Bezier curves, which are off by 0.03 % of the radius at most."""
        bow = _QUARTER * radius
        curves = [f"{self._at(x + radius, y)} m"]
        for i, k in ((1, 0), (0, 1), (-1, 0), (0, -1)):  # the quarter from direction (i, k) to (-k, i)
            places = (
                (x + i * radius - k * bow, y + k * radius + i * bow),
                (x - k * radius + i * bow, y + i * radius + k * bow),
                (x - k * radius, y + i * radius),
            )
            curves.append(" ".join(self._at(*place) for place in places) + " c")
        self._parts.append(" ".join((*curves, "f")))

    def line(self, x: float, y: float, to_x: float, to_y: float, width: float = 0.2) -> None:
        """A line."""
        self._parts.append(f"{_points(width)} w {self._at(x, y)} m {self._at(to_x, to_y)} l S")

    def text(self, x: float, y: float, words: str, size: float = 3.5) -> None:
        """Words, from the left end of their base line; Latin letters only."""
        escaped = words.replace("\\", r"\\").replace("(", r"\(").replace(")", r"\)")
        self._parts.append(f"BT /F1 {_points(size)} Tf {self._at(x, y)} Td ({escaped}) Tj ET")

    def _at(self, x: float, y: float) -> str:
        return f"{_points(x)} {_points(self.height - y)}"

    def content(self) -> bytes:
        """What is drawn, in PDF's operators."""
        return "\n".join(self._parts).encode("cp1252")


def _points(mm: float) -> str:
    return f"{mm / _POINT_MM:.5f}"


def pdf(pages: Sequence[Page]) -> bytes:
    """The file of some pages (PDF 1.4, ISO 32000-1)."""
    first = 4  # after catalog, tree of pages and font
    kids = " ".join(f"{first + 2 * i} 0 R" for i in range(len(pages)))
    objects = [
        _CATALOG.encode(),
        f"<< /Type /Pages /Count {len(pages)} /Kids [{kids}] >>".encode(),
        _FONT.encode(),
    ]
    for i, page in enumerate(pages):
        content = page.content()
        objects += [
            f"<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {_points(page.width)} {_points(page.height)}] "
            f"/Resources << /Font << /F1 3 0 R >> >> /Contents {first + 2 * i + 1} 0 R >>".encode(),
            b"<< /Length %d >>\nstream\n%b\nendstream" % (len(content), content),
        ]
    text, places = b"%PDF-1.4\n%\xe2\xe3\xcf\xd3\n", []
    for number, body in enumerate(objects, start=1):
        places.append(len(text))
        text += b"%d 0 obj\n%b\nendobj\n" % (number, body)
    table = b"".join(b"%010d 00000 n \n" % place for place in places)
    size = len(objects) + 1
    end = b"trailer\n<< /Size %d /Root 1 0 R >>\nstartxref\n%d\n%%%%EOF\n" % (size, len(text))
    return text + b"xref\n0 %d\n0000000000 65535 f \n%b" % (size, table) + end
