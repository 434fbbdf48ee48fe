"""Soft discs and bars against images that are drawn without the models."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from analysis.candidates.foreground.background import Background, Region
from analysis.candidates.markers.known_discs import DiscShape, Windows, fit_known_discs
from analysis.candidates.markers.soft_discs import fit_soft_discs
from analysis.candidates.model import ExpectedSki, Trace
from analysis.candidates.skis.bar_model import Bar, pixels_around
from analysis.candidates.skis.bar_model import modelled as model_of_bars
from analysis.candidates.skis.ski_fit import fit_bars
from analysis.candidates.skis.ski_widths import SkiWidth, clear_widths, told_apart
from analysis.candidates.skis.traces import find_expected_traces, find_traces
from analysis.scene.static_image import StaticImage
from rig.arrays import Floats
from tests.analysis.scene.rendering import Spot, clean_image

NOISE = 2.5
_PARTS = 8  # of a pixel, along each axis


def test_centres_of_streaks_have_sigmas_that_hold() -> None:
    rng = np.random.default_rng(7)
    count, pitch = 60, 24
    places = np.column_stack((np.full(count, 12.0), 12.0 + pitch * np.arange(count))) + rng.uniform(
        -0.5, 0.5, (count, 2)
    )
    half = np.array((0.6, 0.2))  # px of motion, a third of it down
    discs = [
        Spot(float(x), float(y), 1.6, 15.0) for xy in places for x, y in xy + np.linspace(-1, 1, 12)[:, None] * half
    ]
    clean = clean_image((24, pitch * count), discs, 40.0, 0.6)
    noisy = (clean + NOISE * rng.standard_normal(clean.shape)).astype(np.float32)
    fitted = fit_soft_discs(noisy, np.full(clean.shape, NOISE, np.float32), np.rint(places), np.full(count, 1.6))
    assert fitted.good.all()
    off = fitted.xy - places
    squares = np.einsum("ni,nij,nj->n", off, np.linalg.inv(fitted.covariance), off) / 2
    # 120 squares scatter by 2 / sqrt(120) = 0.18 about 1
    assert 0.55 < squares.mean() < 1.45
    assert abs(float(np.median(fitted.radius)) - 1.6) < 0.3


@pytest.mark.parametrize("cover", [90.0, 215.0, 20.0], ids=["a little darker", "brighter", "much darker"])
def test_centres_of_partly_covered_discs_have_sigmas_that_hold(cover: float) -> None:
    """A straight border covers up to nine tenths of the diameter, from eight sides."""
    rng = np.random.default_rng(11)
    radius, side, count = 3.0, 29, 96
    depths = np.tile(np.linspace(0.0, 0.9, 12), 8)  # shares of the diameter
    angles = np.repeat(np.arange(8) * np.pi / 4 + 0.2, 12)
    centres = (side - 1) / 2 + rng.uniform(-0.5, 0.5, (count, 2))
    images = np.stack(
        [
            _covered_disc(side, centre, radius, angle, (1 - 2 * depth) * radius, cover)
            for centre, angle, depth in zip(centres, angles, depths, strict=True)
        ]
    )
    images += NOISE * rng.standard_normal(images.shape)
    # What a fit without knowledge of the size finds is the middle of the visible part.
    starts = centres - 0.9 * (depths * radius)[:, None] * np.column_stack((np.cos(angles), np.sin(angles)))
    shape = DiscShape(np.full(count, radius), 0.04, np.zeros((count, 2)), 130.0, 32.0)
    found = fit_known_discs(Windows(starts, images, np.full(images.shape, NOISE)), shape)
    clear = depths < 0.4
    assert np.isfinite(found.xy[clear]).all()
    off = found.xy - centres
    there = np.asarray(np.isfinite(off).all(axis=1))
    assert there[depths > 0.7].mean() < 0.2, "of a sliver nothing is told"
    squares = np.einsum("ni,nij,nj->n", off[there], np.linalg.inv(found.covariance[there]), off[there]) / 2
    assert squares.mean() < 1.5
    assert (squares > 9).mean() <= 0.05
    assert np.sqrt((off[clear] ** 2).mean()) < 0.1, "px: starts are off by up to 0.9"


@pytest.mark.parametrize("border", [2.5, 3.0])
def test_something_faint_beside_a_disc_does_not_pull_it(border: float) -> None:
    """A sleeve a little brighter than the suit begins a pixel beside a marker, in all images alike."""
    rng = np.random.default_rng(5)
    radius, side, count = 1.6, 21, 64
    angles = np.arange(count) * 2 * np.pi / count
    towards = np.column_stack((np.cos(angles), np.sin(angles)))
    centres = (side - 1) / 2 + rng.uniform(-0.5, 0.5, (count, 2))
    images = np.stack(
        [_beside(side, centre, radius, angle, border) for centre, angle in zip(centres, angles, strict=True)]
    )
    images += NOISE * rng.standard_normal(images.shape)
    shape = DiscShape(np.full(count, radius), 0.04, np.zeros((count, 2)), 130.0, 32.0)
    starts = centres + rng.normal(0.0, 0.15, centres.shape)
    found = fit_known_discs(Windows(starts, images, np.full(images.shape, NOISE)), shape)
    off = found.xy - centres
    # noise moves one centre by 0.03 px, their mean by 0.004
    assert abs(float((off * towards).sum(axis=1).mean())) < 0.022, "px"
    squares = np.einsum("ni,nij,nj->n", off, np.linalg.inv(found.covariance), off) / 2
    assert 0.3 < squares.mean() < 0.95


def test_discs_tell_their_size_themselves() -> None:
    """They are larger than expected, and half of them are partly covered: these need the size."""
    rng = np.random.default_rng(11)
    radius, side, count = 3.0, 29, 48
    depths = np.tile((0.0, 0.0, 0.0, 0.15, 0.25, 0.35), 8)  # shares of the diameter
    angles = np.repeat(np.arange(8) * np.pi / 4 + 0.2, 6)
    centres = (side - 1) / 2 + rng.uniform(-0.5, 0.5, (count, 2))
    images = np.stack(
        [
            _covered_disc(side, centre, radius, angle, (1 - 2 * depth) * radius, 90.0)
            for centre, angle, depth in zip(centres, angles, depths, strict=True)
        ]
    )
    images += NOISE * rng.standard_normal(images.shape)
    starts = centres - 0.9 * (depths * radius)[:, None] * np.column_stack((np.cos(angles), np.sin(angles)))
    shape = DiscShape(np.full(count, 0.88 * radius), 0.04, np.zeros((count, 2)), 130.0, 32.0)
    found = fit_known_discs(Windows(starts, images, np.full(images.shape, NOISE)), shape)
    off = found.xy - centres
    assert np.sqrt((off**2).mean()) < 0.07, "px"
    squares = np.einsum("ni,nij,nj->n", off, np.linalg.inv(found.covariance), off) / 2
    assert squares.mean() < 1.0


def test_discs_tell_their_contrast_themselves() -> None:
    """They are brighter than the spots that were first fitted to them, and a sliver is no whole disc that is faint."""
    rng = np.random.default_rng(11)
    radius, side, count = 1.4, 21, 96
    covered = np.arange(count) % 3 == 0
    angles = rng.uniform(0.0, 2 * np.pi, count)
    centres = (side - 1) / 2 + rng.uniform(-0.5, 0.5, (count, 2))
    images = np.stack(
        [
            _covered_disc(side, centre, radius, angle, (-0.3 if hidden else 2.0) * radius, 70.0)
            for centre, angle, hidden in zip(centres, angles, covered, strict=True)
        ]
    )
    images += NOISE * rng.standard_normal(images.shape)
    away = np.where(covered, 0.6 * radius, 0.0)
    starts = centres - away[:, None] * np.column_stack((np.cos(angles), np.sin(angles)))
    shape = DiscShape(np.full(count, radius), 0.04, np.zeros((count, 2)), 95.0, 24.0)
    found = fit_known_discs(Windows(starts, images, np.full(images.shape, NOISE)), shape)
    there = np.asarray(np.isfinite(found.xy).all(axis=1))
    assert there[~covered].mean() > 0.95
    assert there[covered].mean() < 0.1


def _beside(side: int, centre: Floats, radius: float, angle: float, border: float) -> NDArray[np.float64]:
    """A bright disc; beyond a line at `border` px from its centre the ground is brighter by a seventh of it."""
    steps = (np.arange(side * _PARTS) + 0.5) / _PARTS - 0.5
    x, y = np.meshgrid(steps - centre[0], steps - centre[1])
    ground = np.where(x * np.cos(angle) + y * np.sin(angle) > border, 78.0, 60.0)
    image = np.where(np.hypot(x, y) < radius, 190.0, ground)
    return np.asarray(gaussian_filter(image.reshape(side, _PARTS, side, _PARTS).mean(axis=(1, 3)), 0.55))


def _covered_disc(
    side: int, centre: Floats, radius: float, angle: float, border: float, cover: float
) -> NDArray[np.float64]:
    """A bright disc on a darker ground; beyond a line at `border` px from its centre there is something else."""
    steps = (np.arange(side * _PARTS) + 0.5) / _PARTS - 0.5
    x, y = np.meshgrid(steps - centre[0], steps - centre[1])
    image = np.where(np.hypot(x, y) < radius, 190.0, 60.0)
    if border < radius:
        image = np.where(x * np.cos(angle) + y * np.sin(angle) > border, cover, image)
    return np.asarray(gaussian_filter(image.reshape(side, _PARTS, side, _PARTS).mean(axis=(1, 3)), 0.55))


def test_derivatives_of_bars() -> None:
    region = _region(np.full((30, 60), 60.0), np.full((30, 60), 60.0))
    bars = [Bar(np.array(((8.0, 10.0), (50.0, 14.0))), 3.0), Bar(np.array(((10.0, 12.0), (52.0, 15.0))), 3.0)]
    pixels = pixels_around(region, bars, brighter=True)
    x, y, behind = (part.astype(float) for part in (pixels.x, pixels.y, pixels.behind))
    pixels = replace(pixels, x=x, y=y, behind=behind)  # 32 bits are too few for numeric derivatives
    widths = 0.3, 0.5
    theta = np.concatenate(
        ([180.0, -0.4], *((*bar.line(pixels.origin), h) for bar, h in zip(bars, widths, strict=True)))
    )
    _, design = model_of_bars(pixels, theta)
    for i in range(len(theta)):
        step = np.zeros(len(theta))
        step[i] = 1e-5
        numeric = (model_of_bars(pixels, theta + step)[0] - model_of_bars(pixels, theta - step)[0]) / 2e-5
        np.testing.assert_allclose(design[i], numeric, atol=2e-4)


def test_two_skis_that_nearly_cover_each_other_are_told_apart() -> None:
    rng = np.random.default_rng(3)
    truth = [((8.3, 20.2), (78.0, 17.1)), ((15.1, 21.4), (85.2, 18.6))]
    clean = np.full((40, 95), 90.0)
    for a, b in truth:
        clean += _share(clean.shape, np.array(a), np.array(b), 1.35) * (210.0 - clean)
    clean = gaussian_filter(clean, 0.55)
    found = []
    for _ in range(8):
        region = _region(clean + NOISE * rng.standard_normal(clean.shape), np.full(clean.shape, 90.0))
        merged = Bar(np.array(((8.0, 20.5), (85.0, 18.0))), 3.6)
        apart = [Bar(np.array(((8.0, 19.8), (80.0, 17.5))), 2.7), Bar(np.array(((13.0, 21.2), (85.0, 18.5))), 2.7)]
        found.append(fit_bars(region, [[merged], apart], brighter=True, points=24))
    assert [len(bars) for bars in found] == [2] * 8
    for k, (a, b) in enumerate(truth):
        for bars in found:
            u = (np.array(b) - a) / np.hypot(*(np.array(b) - a))
            off = (bars[k].xy - a) @ np.array((-u[1], u[0]))
            middle = np.average(off, weights=bars[k].sigma ** -2)
            assert abs(middle) < 0.1, "px: a thirtieth of the width"


@pytest.mark.parametrize(("apart", "turned"), [(2.4, 0.0), (3.6, 0.0), (2.2, 0.5)])
def test_skis_that_hide_each_others_edges_are_placed_by_their_width(apart: float, turned: float) -> None:
    """Nothing but the width tells how far apart they are, at each place."""
    rng = np.random.default_rng(17)
    width, along = 4.4, np.array((78.0, -9.0))
    across = np.array((-along[1], along[0])) / np.hypot(*along)
    first, second = np.array((12.3, 26.2)), np.array((12.3, 26.2)) + 0.04 * along
    ends = [
        np.stack((first, first + along)),
        np.stack((second + (apart - turned) * across, second + along + (apart + turned) * across)),
    ]
    clean = np.full((50, 110), 70.0)
    for a, b in ends:
        clean += _capsule(clean.shape, a, b, width / 2) * (200.0 - clean)
    clean = gaussian_filter(clean, 0.5)
    before, after = [], []
    for _ in range(4):
        region = _region(clean + NOISE * rng.standard_normal(clean.shape), np.full(clean.shape, 70.0))
        traces = find_traces(region)
        told = told_apart(traces, width, 0.02)
        assert len(told) == 2
        for line in ends:
            before.append(min((_normalized(trace, line) for trace in traces), key=lambda z: abs(z[0])))
            after.append(min((_normalized(trace, line) for trace in told), key=lambda z: abs(z[0])))
    if not turned:
        assert np.mean(np.square(before)) > 4.0, "a fit takes them for one"
    assert np.mean(np.square(after)) < 2.0


@pytest.mark.parametrize(
    ("begin", "end"), [((14.0, 44.0), (99.0, 36.0)), ((11.0, 36.0), (97.0, 21.0)), ((13.0, 31.4), (96.0, 12.6))]
)
def test_skis_are_fitted_from_where_they_are_expected(begin: tuple[float, float], end: tuple[float, float]) -> None:
    """Apart, crossing, nearly covering each other: a start that is off by a ski's width or less spoils nothing."""
    rng = np.random.default_rng(29)
    lines = [np.array(((10.0, 30.0), (95.0, 12.0))), np.array((begin, end))]
    clean = np.full((60, 110), 70.0)
    for a, b in lines:
        clean += _capsule(clean.shape, a, b, 2.2) * (200.0 - clean)
    clean = gaussian_filter(clean, 0.5)
    normalized = []
    for _ in range(6):
        region = _region(clean + NOISE * rng.standard_normal(clean.shape), np.full(clean.shape, 70.0))
        off = rng.normal(0.0, (3.0, 0.7), (2, 2, 2))  # px along and across, about
        traces = find_expected_traces(
            region, [ExpectedSki(line + o, 4.2, True, 0.7) for line, o in zip(lines, off, strict=True)]
        )
        for line in lines:
            normalized.append(
                min((_normalized(trace, line) for trace in told_apart(traces, 4.4, 0.02)), key=lambda z: abs(z[0]))
            )
    assert np.mean(np.square(normalized)) < 2.0
    nothing = _region(70.0 + NOISE * rng.standard_normal(clean.shape), np.full(clean.shape, 70.0))
    assert not find_expected_traces(nothing, [ExpectedSki(lines[0], 4.2, True, 0.7)])


@pytest.mark.parametrize("steep", [False, True])
def test_skis_that_are_known_vaguely_are_sought_where_they_may_be(steep: bool) -> None:
    """A pole is as thin and bright as they are. Nothing is left out where no line is found that may be a ski."""
    rng = np.random.default_rng(31)
    right, left, pole = (
        np.array(ends) for ends in (((10.0, 30.0), (95.0, 12.0)), ((12.0, 52.0), (97.0, 44.0)), ((10, 80), (95, 81)))
    )
    clean = np.full((95, 110), 70.0)
    for a, b in (right, left, pole):
        clean += _capsule(clean.shape, a, b, 2.2) * (200.0 - clean)
    clean = gaussian_filter(clean, 0.5) + NOISE * rng.standard_normal(clean.shape)
    region = _region(clean.T if steep else clean, np.full(clean.T.shape if steep else clean.shape, 70.0))
    turn = slice(None, None, -1 if steep else 1)
    off = np.array((0.0, 5.0))  # px, more than a width

    def expected(*skis: Floats) -> list[ExpectedSki]:
        return [ExpectedSki((ski + off)[:, turn], 4.2, True, 3.0) for ski in skis]

    everything = find_traces(region)
    found = find_traces(region, expected(right, left))
    assert len(found) == 2 < len(everything)
    for line in (right, left):
        shift, turned = min((_normalized(trace, line[:, turn]) for trace in found), key=lambda z: abs(z[0]))
        assert abs(shift) < 4.0
        assert abs(turned) < 4.0
    nowhere = find_traces(region, expected(right - (0.0, 60.0)))
    assert [trace.xy.tolist() for trace in nowhere] == [trace.xy.tolist() for trace in everything]


def test_two_flat_skis_of_a_v_are_not_equally_wide() -> None:
    """Along half of the wider one a leg hides an edge: there the axis is half of its own width from the other edge."""
    rng = np.random.default_rng(31)
    skis = [(np.array(((12.0, 44.0), (72.0, 10.0))), 1.9), (np.array(((12.0, 45.5), (97.0, 33.0))), 1.0)]
    clean = np.full((60, 110), 120.0)
    for (a, b), half in skis:
        clean += _capsule(clean.shape, a, b, half) * (215.0 - clean)
    (a, b), _ = skis[0]
    along = (b - a) / np.hypot(*(b - a))
    leg = np.array((0.55 * a + 0.45 * b, b + 3 * along)) + 4.2 * np.array((along[1], -along[0]))
    clean += _capsule(clean.shape, leg[0], leg[1], 3.6) * (45.0 - clean)
    clean = gaussian_filter(clean, 0.5)
    errors, normalized = [], []
    for _ in range(8):
        traces = find_traces(_region(clean + NOISE * rng.standard_normal(clean.shape), np.full(clean.shape, 120.0)))
        for line, half in skis:
            trace = min(traces, key=lambda trace: abs(_normalized(trace, line)[0]))
            assert trace.width == pytest.approx(2 * half, rel=0.15)
            normalized.append(_normalized(trace, line))
            errors.append(normalized[-1][0] * np.hypot(trace.common, (trace.sigma**-2.0).sum() ** -0.5))
    assert np.sqrt(np.mean(np.square(errors))) < 0.08, "px: with one width for both 0.3"
    assert np.mean(np.square(normalized)) < 1.5


def test_a_ski_of_another_width_has_an_edge_that_is_not_its_own() -> None:
    xy = np.column_stack((np.linspace(10, 80, 15), np.full(15, 20.0)))
    usual = Trace(
        xy,
        np.full(15, 0.05),
        0.02,
        np.array(((8.0, 20.0), (82.0, 20.0))),
        4.4,
        120.0,
        np.zeros(15),
        np.zeros(15),
        0.03,
        0.0,
        0.02,
    )
    (right,), (narrow,) = (told_apart([trace], 4.4, 0.02) for trace in (usual, replace(usual, width=3.4)))
    assert right.common == usual.common
    assert narrow.common == pytest.approx(0.5, abs=0.02)


@pytest.mark.parametrize(("apart", "common"), [(0.5, 0.29), (1.5, 0.05)])
def test_skis_that_nearly_cover_each_other_may_lie_anywhere_within_a_pixel(apart: float, common: float) -> None:
    xy = np.column_stack((np.linspace(10, 80, 15), np.full(15, 20.0)))
    ends, aside = np.array(((8.0, 20.0), (82.0, 20.0))), np.array((0.0, apart))
    one = Trace(xy, np.full(15, 0.05), 0.02, ends, 4.4, 120.0, np.ones(15), np.full(15, np.nan), 0.03, 0.0, 0.02)
    two = replace(one, xy=xy + aside, ends=ends + aside, one_sided=-np.ones(15))
    assert [trace.common for trace in told_apart([one, two], 4.4, 0.02)] == pytest.approx([common] * 2, abs=0.01)


def test_where_one_of_two_skis_ends_too_early_the_other_one_may_be_what_is_seen() -> None:
    xy = np.column_stack((np.linspace(10, 80, 15), np.full(15, 20.0)))
    ends, aside = np.array(((8.0, 20.0), (82.0, 20.0))), np.array((0.0, 0.8))
    whole = Trace(xy, np.full(15, 0.05), 0.02, ends, 4.4, 120.0, np.zeros(15), np.full(15, np.nan), 0.03, 0.0, 0.02)
    short = replace(whole, xy=xy[5:] + aside, sigma=whole.sigma[5:], ends=np.array(((32.0, 20.8), (82.0, 20.8))))
    short = replace(short, one_sided=whole.one_sided[5:], widening=whole.widening[5:])
    doubtful = told_apart([whole, short], 4.4, 0.02)[0]
    assert (doubtful.sigma[:5] > 1.0).all()
    assert doubtful.sigma[5:] == pytest.approx(0.05)
    far = replace(short, xy=short.xy + aside, ends=short.ends + aside)
    assert told_apart([whole, far], 4.4, 0.02)[0].sigma == pytest.approx(0.05)


def test_skis_that_lie_apart_tell_their_width() -> None:
    rng = np.random.default_rng(23)
    clean = np.full((60, 110), 70.0)
    for a, b in (((10.0, 30.0), (95.0, 12.0)), ((12.0, 33.0), (99.0, 42.0))):
        clean += _capsule(clean.shape, np.array(a), np.array(b), 2.2) * (200.0 - clean)
    clean = gaussian_filter(clean, 0.5)
    widths = []
    for _ in range(4):
        grey = clean + NOISE * rng.standard_normal(clean.shape)
        widths += clear_widths(find_traces(_region(grey, np.full(clean.shape, 70.0))))
    known = SkiWidth.of(widths)
    assert known is not None
    assert known.m == pytest.approx(4.4, rel=0.03)
    assert known.spread < 0.04


def test_changing_light_and_shake_are_no_movement() -> None:
    rng = np.random.default_rng(5)
    scene = gaussian_filter(rng.uniform(0, 1, (120, 160)), 3.0)
    scene = 60 + 100 * (scene - scene.min()) / np.ptp(scene)
    static = StaticImage("K1", scene.astype(np.float32), np.full(scene.shape, NOISE, np.float32), 31)
    moved = np.roll(scene, 1, axis=1) * 0.3 + scene * 0.7  # 0.3 px to the right
    image = 0.75 * moved + 9.0 + NOISE * rng.standard_normal(scene.shape)
    background = Background(static)
    assert background.regions(_uint8(image)) == []
    image[50:64, 70:92] += 40.0
    (region,) = background.regions(_uint8(image))
    assert region.holds(np.array((80.0, 57.0)))
    assert abs(float(np.median(region.noise)) / NOISE - 1) < 0.2


def _uint8(image: Floats) -> NDArray[np.uint8]:
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def _region(grey: Floats, behind: Floats) -> Region:
    sigma = np.full(grey.shape, NOISE, np.float32)
    front = np.abs(grey - behind) > 4 * NOISE
    return Region(0, 0, grey.astype(np.float32), behind.astype(np.float32), sigma, sigma, front)


def _normalized(trace: Trace, line: Floats) -> tuple[float, float]:
    """How far a trace is shifted and turned from a line (2, 2) through two places, over the standard deviations."""
    along = (line[1] - line[0]) / np.hypot(*(line[1] - line[0]))
    off, place = (trace.xy - line[0]) @ np.array((-along[1], along[0])), (trace.xy - line[0]) @ along
    weight = trace.sigma**-2
    place = place - np.average(place, weights=weight)
    shift, turn = np.average(off, weights=weight), weight @ (off * place) / (weight @ place**2)
    return float(shift / np.hypot(trace.common, weight.sum() ** -0.5)), float(turn * np.sqrt(weight @ place**2))


def _capsule(shape: tuple[int, ...], a: Floats, b: Floats, radius: float) -> Floats:
    """Which share of each pixel a bar with round ends covers."""
    steps = (np.arange(_PARTS) + 0.5) / _PARTS - 0.5
    y = (np.arange(shape[0])[:, None] + steps).ravel()[:, None] - a[1]
    x = (np.arange(shape[1])[:, None] + steps).ravel() - a[0]
    place = np.clip((x * (b - a)[0] + y * (b - a)[1]) / ((b - a) @ (b - a)), 0, 1)
    inside = np.hypot(x - place * (b - a)[0], y - place * (b - a)[1]) < radius
    return np.asarray(inside.reshape(shape[0], _PARTS, shape[1], _PARTS).mean(axis=(1, 3)))


def _share(shape: tuple[int, ...], a: Floats, b: Floats, half: float) -> Floats:
    """Which share of each pixel a rectangle about an axis covers."""
    steps = (np.arange(_PARTS) + 0.5) / _PARTS - 0.5
    y = (np.arange(shape[0])[:, None] + steps).ravel()[:, None] - a[1]
    x = (np.arange(shape[1])[:, None] + steps).ravel() - a[0]
    length = float(np.hypot(*(b - a)))
    u = (b - a) / length
    inside = (np.abs(y * u[0] - x * u[1]) < half) & (x * u[0] + y * u[1] > 0) & (x * u[0] + y * u[1] < length)
    return np.asarray(inside.reshape(shape[0], _PARTS, shape[1], _PARTS).mean(axis=(1, 3)))
