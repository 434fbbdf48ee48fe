"""Reports: text and page from the same parts; the drawings show the numbers of the adjustment."""

import re
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from photogrammetry.adjustment.run import adjust
from photogrammetry.adjustment.solution.adjustment import Adjustment
from photogrammetry.network.model import ImageFrame, ImageObservations, Network
from photogrammetry.reports.adjusted import adjusted_sections
from photogrammetry.reports.document import Drawing, Report, Section, Table, as_html, as_text, write_report
from photogrammetry.reports.drawing.network import network_drawings
from photogrammetry.reports.drawing.residuals import cell_means, histogram, redundancy_drawing, residual_drawings
from photogrammetry.reports.drawing.svg import Colour
from photogrammetry.reports.drawing.to_scale import Canvas, nice, rounded_up, ticks
from tests.photogrammetry.drawn import SVG, bar, chart_scales, parsed, polyline
from tests.photogrammetry.synthetic import hill, lab_frame, rods


def _report() -> Report:
    table = Table(("name", "value"), (("a<b", "1"), ("long name", "22")))
    drawing = Drawing("a & b", Canvas(np.eye(2)).svg.rendered("a & b"))
    told = Drawing("told", drawing.svg, ("in words",))
    return Report(
        "Title", (Section("One", ("words & signs", table)), Section("Drawn", (drawing,)), Section("Told", (told,)))
    )


@pytest.fixture(scope="module")
def adjusted() -> dict[str, Adjustment]:
    networks = {"hill": hill(1).network, "lab": lab_frame(1).network, "rods": rods(1).network}
    return {name: adjust(network).adjustment for name, network in networks.items()}


def test_text_is_aligned_and_leaves_drawings_out() -> None:
    text = as_text(_report())
    assert "  name       value\n  a<b            1\n  long name     22\n" in text
    assert "svg" not in text
    assert "Drawn" not in text
    assert "Told\n----\nin words\n" in text


def test_page_is_escaped_and_well_formed() -> None:
    page = as_html(_report())
    assert "words &amp; signs" in page
    assert "<td>a&lt;b</td>" in page
    body = re.search(r"<body>.*</body>", page, re.DOTALL)
    assert body is not None
    tree = ET.fromstring(body.group())  # noqa: S314 - our own words
    assert tree.find(f"div[@class='drawings']/figure/{SVG}svg") is not None
    assert tree.find("div[@class='table']/table/tbody/tr/td") is not None


def test_a_whole_page_needs_nothing_from_elsewhere(adjusted: dict[str, Adjustment]) -> None:
    page = as_html(Report("Lab", adjusted_sections(adjust(adjusted["lab"].network))))
    body = re.search(r"<body>.*</body>", page, re.DOTALL)
    assert body is not None
    ET.fromstring(body.group())  # noqa: S314 - our own words
    assert set(re.findall(r"\w+://[^\"' <]+", page)) == {"http://www.w3.org/2000/svg"}  # a name, never fetched
    assert not re.search(r"<script|<link|<img|<iframe|@import|url\(|\bsrc=|\bhref=", page)
    used = set(re.findall(r'<(?:line|circle|polygon|polyline|rect|ellipse) class="(\w+)"', page))
    assert used <= {colour.value for colour in Colour}
    for colour in used:  # defined for light and for dark
        assert page.count(f"--{colour}:#") == 2


def test_report_is_written_where_it_is_wanted(tmp_path: Path) -> None:
    text, page = write_report(_report(), tmp_path / "deep" / "folder")
    assert text.read_text() == as_text(_report())
    assert page.read_text() == as_html(_report())


def test_ellipse_has_the_axes_and_the_direction_of_the_covariance() -> None:
    canvas = Canvas(np.array([[0.0, 0.0], [10.0, 10.0]]))
    turn = np.radians(30.0)
    axes = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    canvas.ellipse(np.array([5.0, 5.0]), axes @ np.diag([0.04, 0.01]) @ axes.T, 10.0, Colour.RED)
    ellipse = parsed(canvas.svg.rendered("")).find(f"{SVG}ellipse")
    assert ellipse is not None
    assert float(ellipse.attrib["rx"]) == pytest.approx(2.0 / canvas.unit, abs=0.1)
    assert float(ellipse.attrib["ry"]) == pytest.approx(1.0 / canvas.unit, abs=0.1)
    angle = float(ellipse.attrib["transform"].split("rotate(")[1].rstrip(")"))
    assert angle % 180.0 == pytest.approx(150.0, abs=0.1)  # clockwise on a page


@pytest.mark.parametrize("name", ["hill", "lab", "rods"])
def test_everything_in_the_network_is_drawn(adjusted: dict[str, Adjustment], name: str) -> None:
    """The whole from two sides with the cameras' ellipses, then the points from two sides with theirs."""
    a = adjusted[name]
    whole, near = network_drawings(a)[:2], network_drawings(a)[2:]
    assert len(whole) == len(near) == 2
    for drawing in whole:
        tree = parsed(drawing.svg)
        assert len(tree.findall(f"{SVG}polygon")) == len(tree.findall(f"{SVG}ellipse")) == len(a.network.images)
        assert len(tree.findall(f"{SVG}circle")) == len(a.network.points)
    for drawing in near:
        tree = parsed(drawing.svg)
        assert len(tree.findall(f"{SVG}circle")) == len(tree.findall(f"{SVG}ellipse")) == len(a.network.points)
        assert not tree.findall(f"{SVG}polygon")


def test_ellipses_are_as_large_as_the_caption_says(adjusted: dict[str, Adjustment]) -> None:
    a = adjusted["hill"]
    for axes, drawing in zip(([0, 1], [0, 2]), network_drawings(a)[2:], strict=True):
        tree = parsed(drawing.svg)
        metres, unit = bar(tree)
        assert unit == "m"
        said = re.search(r"([\d.]+) times as large", drawing.caption)
        assert said is not None
        for columns, ellipse in zip(a.problem.unknowns.point[:, axes], tree.findall(f"{SVG}ellipse"), strict=True):
            large = np.sqrt(np.linalg.eigvalsh(a.covariance(columns))[-1])
            drawn = float(ellipse.attrib["rx"]) * metres / float(said.group(1))
            assert drawn == pytest.approx(large, rel=0.02)


def test_histogram_counts_the_test_values(adjusted: dict[str, Adjustment]) -> None:
    a = adjusted["rods"]
    w = np.concatenate([a.image_w().ravel(), a.relation_w()])
    w = w[np.isfinite(w)]
    drawing = histogram(a)
    tree = parsed(drawing.svg)
    x, y = chart_scales(tree)
    expected, edges = np.histogram(np.clip(w, -4.99, 4.99), bins=20, range=(-5.0, 5.0))
    for box, count, left in zip(tree.findall(f"{SVG}rect"), expected, edges, strict=False):
        top, bottom = float(box.attrib["y"]), float(box.attrib["y"]) + float(box.attrib["height"])
        assert y(top) == pytest.approx(count, abs=0.1)
        assert y(bottom) == pytest.approx(0.0, abs=0.1)
        assert x(float(box.attrib["x"])) == pytest.approx(left, abs=0.03)
    curve = polyline(tree.findall(f"{SVG}polyline")[0])
    assert y(curve[:, 1].min()) == pytest.approx(len(w) * 0.5 / np.sqrt(2.0 * np.pi), rel=0.02)
    rows = [re.match(r"\s+([+-]\d) \.\. .*?(\d+) \(", line) for line in drawing.text]
    assert sum(int(row.group(2)) for row in rows if row is not None) == len(w)
    middle = next(int(row.group(2)) for row in rows if row is not None and row.group(1) == "+0")
    assert middle == np.sum((w >= 0.0) & (w < 1.0))


def test_redundancy_numbers_of_each_image(adjusted: dict[str, Adjustment]) -> None:
    a = adjusted["hill"]
    tree = parsed(redundancy_drawing(a).svg)
    numbers, start = a.controlled.image_numbers, a.problem.start
    y = chart_scales(tree)[1]
    dots = [c for c in tree.findall(f"{SVG}circle") if c.attrib["r"] == "2.5"]
    spreads = [e for e in tree.findall(f"{SVG}line") if e.attrib["stroke-width"] == "1.5"]
    assert len(dots) == len(spreads) == len(a.network.images)
    for i, (dot, spread) in enumerate(zip(dots, spreads, strict=True)):
        r = numbers[start[i] : start[i + 1]]
        assert y(float(dot.attrib["cy"])) == pytest.approx(r.mean(), abs=0.002)
        assert y(float(spread.attrib["y1"])) == pytest.approx(r.min(), abs=0.002)
        assert y(float(spread.attrib["y2"])) == pytest.approx(r.max(), abs=0.002)


def test_distortion_left_over_shows_against_the_radius() -> None:
    """A lens with distortion, adjusted without it: the mean radial residuals show the distortion."""
    network = lab_frame(1).network
    bent = tuple(replace(camera, estimate=("c", "x0", "y0")) for camera in network.cameras)
    o = network.observations
    r2 = np.sum(o.xy**2, axis=1, keepdims=True)
    network = replace(network, cameras=bent, observations=replace(o, xy=o.xy * (1.0 + 4e-7 * r2)))
    a = adjust(network).adjustment
    drawing = next(d for d in residual_drawings(a) if "Camera K1: residuals (adj" in d.caption)
    tree = parsed(drawing.svg)
    x, y = chart_scales(tree)
    rows = a.problem.camera == 0
    reduced = a.problem.xy[rows] - a.state.interior[0, 1:3]
    radius = np.linalg.norm(reduced, axis=1)
    outwards = np.sum(a.image_residuals()[rows] * reduced, axis=1) / radius
    dots = [c for c in tree.findall(f"{SVG}circle") if c.attrib["r"] == "1.1"]
    found = np.array([(x(float(c.attrib["cx"])), y(float(c.attrib["cy"]))) for c in dots])
    assert found[:, 0] == pytest.approx(radius, abs=0.2)
    assert found[:, 1] == pytest.approx(outwards, abs=0.02 * np.abs(outwards).max())
    curve = polyline(tree.findall(f"{SVG}polyline")[0])
    means = np.array([y(place) for place in curve[:, 1]])
    outermost = np.sort(radius)[-len(radius) // 10 :]
    assert means[-1] == pytest.approx(outwards[radius >= outermost[0]].mean(), rel=0.1)
    assert np.abs(means).max() > 3.0 * 0.18 / np.sqrt(len(radius) / 10)


@pytest.mark.parametrize("name", ["hill", "lab", "rods"])
def test_every_residual_is_drawn_to_the_scale_of_the_bar(adjusted: dict[str, Adjustment], name: str) -> None:
    a = adjusted[name]
    drawings = [d for d in residual_drawings(a) if d.caption.startswith("Image ")]
    assert len(drawings) == len(a.network.images)
    for i, drawing in enumerate(drawings):
        tree = parsed(drawing.svg)
        pixels, unit = bar(tree)
        assert unit == "px"
        lines = [e for e in tree.findall(f"{SVG}line") if e.attrib["stroke-width"] == "1.2"]
        ends = np.array([[float(e.attrib[k]) for k in ("x1", "y1", "x2", "y2")] for e in lines])
        vectors = (ends[:, 2:] - ends[:, :2]) * (1.0, -1.0) * pixels
        rows = slice(a.problem.start[i], a.problem.start[i + 1])
        assert vectors == pytest.approx(a.image_residuals()[rows], abs=0.15 * pixels)


def test_of_many_images_the_means_are_drawn() -> None:
    made = lab_frame(1, points=12).network
    images = tuple(replace(image, name=f"{image.name}-{k}") for k in range(3) for image in made.images)
    o = made.observations
    three = {name: np.concatenate([getattr(o, name)] * 3) for name in ("point", "xy", "sigma", "group")}
    image = np.concatenate([o.image + 9 * k for k in range(3)])
    many = ImageObservations(image, three["point"], three["xy"], three["sigma"], three["group"])
    a = adjust(replace(made, images=images, observations=many)).adjustment
    drawings = residual_drawings(a)
    assert not any(d.caption.startswith("Image ") for d in drawings)
    patterns = [d for d in drawings if "mean residual" in d.caption]
    assert len(patterns) == 3
    tree = parsed(patterns[0].svg)
    pixels, _ = bar(tree)
    rows = a.problem.camera == 0
    places, means = cell_means(a.problem.xy[rows], a.image_residuals()[rows])
    lines = [e for e in tree.findall(f"{SVG}line") if e.attrib["stroke-width"] == "1.2"]
    ends = np.array([[float(e.attrib[k]) for k in ("x1", "y1", "x2", "y2")] for e in lines])
    assert (ends[:, 2:] - ends[:, :2]) * (1.0, -1.0) * pixels == pytest.approx(means, abs=0.15 * pixels)
    assert len(places) < rows.sum()


def test_means_of_cells() -> None:
    places = np.array([[0.0, 0.0], [2.0, 1.0], [120.0, 60.0], [115.0, 61.0], [60.0, 0.0]])
    at, means = cell_means(places, np.array([[1.0, 0.0], [3.0, 2.0], [5.0, 5.0], [7.0, 5.0], [9.0, 9.0]]), 1)
    assert at == pytest.approx(np.array([[1.0, 0.5], [60.0, 0.0], [117.5, 60.5]]))
    assert means == pytest.approx(np.array([[2.0, 1.0], [9.0, 9.0], [6.0, 5.0]]))


def test_sections_hold_the_numbers() -> None:
    outcome = adjust(rods(1).network)
    sections = {section.title: section for section in adjusted_sections(outcome)}
    text = as_text(Report("Rods", tuple(sections.values())))
    a = outcome.adjustment
    assert re.search(rf"K1 c +{a.state.interior[0, 0]:.0f} +\d\d +estimated", text)
    measured = next(line for line in text.splitlines() if "distance P11 to P12" in line)
    assert measured.split()[4] == f"{a.relation_residuals()[0]:.5f}"
    table = sections["Points"].parts[0]
    assert isinstance(table, Table)
    assert [row[0] for row in table.rows] == [point.name for point in a.network.points]
    assert float(table.rows[3][3]) == pytest.approx(a.state.xyz[3, 0], abs=1e-3)


def test_metric_frame_without_image_size() -> None:
    network = hill(1).network
    cameras = tuple(replace(camera, size=None) for camera in network.cameras)
    outcome = adjust(replace(network, cameras=cameras, image_frame=ImageFrame.METRIC))
    vectors = [d for d in residual_drawings(outcome.adjustment) if d.caption.startswith("Image ")]
    assert len(vectors) == 3
    assert bar(parsed(vectors[0].svg))[1] == "image units"
    assert "image units" in as_text(Report("Hill", adjusted_sections(outcome)))


def test_a_network_without_images_has_no_drawings() -> None:
    network: Network = hill(1).network
    o = network.observations
    nothing = ImageObservations(o.image[:0], o.point[:0], o.xy[:0], o.sigma[:0], o.group[:0])
    surveyed = tuple(point for point in network.points if point.sigma is not None)
    none = replace(network, images=(), observations=nothing, points=surveyed)
    a = adjust(none).adjustment
    assert network_drawings(a) == ()
    assert residual_drawings(a) == ()


@pytest.mark.parametrize(("low", "high", "most"), [(0.0, 0.0137, 8), (-5.0, 5.0, 8), (3.0, 1017.0, 6), (0.5, 2.5, 8)])
def test_ticks_are_round_and_not_too_many(low: float, high: float, most: int) -> None:
    found = ticks(low, high, most)
    assert 2 <= len(found) <= most
    assert low <= found[0] < found[-1] <= high * (1.0 + 1e-9)
    step = np.diff(found)
    assert step == pytest.approx(step[0])
    assert nice(step[0] * (1.0 + 1e-9)) == pytest.approx(step[0])


def test_axes_end_on_round_numbers() -> None:
    assert rounded_up(0.0113) == pytest.approx(0.012)
    assert rounded_up(7.0) == pytest.approx(7.0)
