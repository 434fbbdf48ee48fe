"""Protocols: text and page from the same parts, drawings to scale."""

import re
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from photogrammetry.adjustment.run import adjust
from photogrammetry.network import ImageFrame, Network
from photogrammetry.protocol.adjusted import adjusted_sections
from photogrammetry.protocol.canvas import Canvas
from photogrammetry.protocol.document import Drawing, Protocol, Section, Table, as_html, as_text, write_protocol
from photogrammetry.protocol.drawings import network_drawings, residual_drawings
from tests.photogrammetry.synthetic import hill, lab_frame, rods

_SVG = "{http://www.w3.org/2000/svg}"


def _protocol() -> Protocol:
    table = Table(("name", "value"), (("a<b", "1"), ("long name", "22")))
    drawing = Drawing("a & b", Canvas(np.eye(2)).svg())
    return Protocol("Title", (Section("One", ("words & signs", table)), Section("Drawn", (drawing,))))


def test_text_is_aligned_and_leaves_drawings_out() -> None:
    text = as_text(_protocol())
    assert "  name       value\n  a<b            1\n  long name     22\n" in text
    assert "svg" not in text
    assert "Drawn" not in text


def test_page_is_escaped_and_well_formed() -> None:
    page = as_html(_protocol())
    assert "words &amp; signs" in page
    assert "<td>a&lt;b</td>" in page
    body = re.search(r"<body>.*</body>", page, re.DOTALL)
    assert body is not None
    tree = ET.fromstring(body.group())  # noqa: S314 - our own words
    assert tree.find(f"figure/{_SVG}svg") is not None


def test_protocol_is_written_where_it_is_wanted(tmp_path: Path) -> None:
    text, page = write_protocol(_protocol(), tmp_path / "deep" / "folder")
    assert text.read_text() == as_text(_protocol())
    assert page.read_text() == as_html(_protocol())


def test_ellipse_has_the_axes_and_the_direction_of_the_covariance() -> None:
    canvas = Canvas(np.array([[0.0, 0.0], [10.0, 10.0]]))
    turn = np.radians(30.0)
    axes = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    canvas.ellipse(np.array([5.0, 5.0]), axes @ np.diag([0.04, 0.01]) @ axes.T, 10.0, "red")
    ellipse = ET.fromstring(canvas.svg()).find(f"{_SVG}ellipse")  # noqa: S314 - our own drawing
    assert ellipse is not None
    assert float(ellipse.attrib["rx"]) == pytest.approx(2.0 / canvas.unit, abs=0.1)
    assert float(ellipse.attrib["ry"]) == pytest.approx(1.0 / canvas.unit, abs=0.1)
    angle = float(ellipse.attrib["transform"].split("rotate(")[1].rstrip(")"))
    assert angle % 180.0 == pytest.approx(150.0, abs=0.1)  # clockwise on a page


@pytest.mark.parametrize(
    "network", [hill(1).network, lab_frame(1).network, rods(1).network], ids=["hill", "lab", "rods"]
)
def test_every_point_image_and_residual_is_drawn(network: Network) -> None:
    a = adjust(network).adjustment
    above, side = network_drawings(a)
    for drawing in (above, side):
        tree = ET.fromstring(drawing.svg)  # noqa: S314 - our own drawing
        assert len(tree.findall(f"{_SVG}circle")) == len(network.points)
        assert len(tree.findall(f"{_SVG}polygon")) == len(network.images)
        assert len(tree.findall(f"{_SVG}ellipse")) == len(network.points) + len(network.images)
        assert "nan" not in drawing.svg
    lines = [d.svg.count("<line") for d in residual_drawings(a)]
    assert len(lines) == len(network.cameras)
    assert sum(lines) == len(network.observations.image)


def test_sections_hold_the_numbers() -> None:
    outcome = adjust(rods(1).network)
    sections = {section.title: section for section in adjusted_sections(outcome)}
    text = as_text(Protocol("Rods", tuple(sections.values())))
    a = outcome.adjustment
    assert f"{a.state.interior[0, 0]:.6g}" in text
    measured = next(line for line in text.splitlines() if "distance P11 to P12" in line)
    assert measured.split()[4] == f"{a.relation_residuals()[0]:.3g}"
    table = sections["Points"].parts[0]
    assert isinstance(table, Table)
    assert [row[0] for row in table.rows] == [point.name for point in a.network.points]
    assert float(table.rows[3][3]) == pytest.approx(a.state.xyz[3, 0], abs=1e-4)


def test_metric_frame_without_image_size() -> None:
    network = hill(1).network
    cameras = tuple(replace(camera, size=None) for camera in network.cameras)
    outcome = adjust(replace(network, cameras=cameras, image_frame=ImageFrame.METRIC))
    assert len(residual_drawings(outcome.adjustment)) == 3
    assert "image units" in as_text(Protocol("Hill", adjusted_sections(outcome)))
