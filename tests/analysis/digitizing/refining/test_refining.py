"""Clicks are refined to the true place, off by what their sigma says; what is not there is refused."""

from contextlib import suppress

import numpy as np
import pytest

from analysis.digitizing.refining.refining import refine_disc, refine_edge, refine_line
from rig.arrays import Floats
from rig.errors import NoFitError
from tests.analysis.digitizing.refining.drawing import bar, disc, drawn, edge, noisy, textured

SIZE = 64
MIDDLE = np.array((32.0, 32.0))
#: The root mean square of n normalized errors scatters by 1 / sqrt(2 n): 0.8 to 1.2 is 3 sigma or more from 140 on.
ROUNDS = 70


def _across(angle: float) -> Floats:
    return np.array((-np.sin(angle), np.cos(angle)))


def _rms(errors: list[float]) -> float:
    return float(np.sqrt(np.mean(np.square(errors))))


@pytest.mark.parametrize(("contrast", "dark"), [(150.0, False), (40.0, False), (-45.0, True)])
def test_a_click_on_a_disc_finds_its_centre(contrast: float, dark: bool) -> None:
    rng = np.random.default_rng(int(contrast) + 1000)
    errors: list[float] = []
    for _ in range(ROUNDS):
        radius, centre = rng.uniform(1.4, 9), rng.uniform(28, 36, 2)
        image = drawn(disc(centre, radius, contrast), SIZE, rng)
        click = centre + rng.uniform(-1, 1, 2) * min(3.0, radius)
        found = refine_disc(image, click, dark=dark)
        errors += list((found.xy - centre) / found.sigma)
        assert abs(found.radius - radius) < 0.5
    assert 0.8 < _rms(errors) < 1.2
    assert abs(np.mean(errors)) < 4 / np.sqrt(len(errors))


@pytest.mark.parametrize("grey", [(60.0, 200.0), (110.0, 90.0)])
def test_a_click_beside_an_edge_finds_its_foot(grey: tuple[float, float]) -> None:
    rng = np.random.default_rng(int(grey[1]))
    errors = []
    for _ in range(2 * ROUNDS):
        place, angle = rng.uniform(28, 36, 2), rng.uniform(0, np.pi)
        image = drawn(edge(place, angle, grey), SIZE, rng)
        click = place + rng.uniform(-1.5, 1.5) * _across(angle)
        found = refine_edge(image, click)
        errors.append(float((found.xy - place) @ _across(angle)) / found.sigma)
        assert abs(float(found.direction @ _across(angle))) < 0.15
        assert abs(float((found.xy - click) @ found.direction)) < 1e-6
    assert 0.8 < _rms(errors) < 1.2
    assert abs(np.mean(errors)) < 4 / np.sqrt(len(errors))


def test_a_click_at_an_edge_of_a_thin_bar_finds_that_edge() -> None:
    rng = np.random.default_rng(5)
    errors = []
    for _ in range(2 * ROUNDS):
        place, angle, half = rng.uniform(28, 36, 2), rng.uniform(0, np.pi), rng.uniform(1.4, 4)
        side = rng.choice((-1, 1))
        image = drawn(bar(place, angle, half, (60, 200, 90)), SIZE, rng)
        click = place + (side * half + rng.uniform(-0.5, 0.5) * half) * _across(angle)
        found = refine_edge(image, click, np.array((np.cos(angle), np.sin(angle))))
        errors.append((float((found.xy - place) @ _across(angle)) - side * half) / found.sigma)
    assert 0.8 < _rms(errors) < 1.2


@pytest.mark.parametrize("half", [0.0, 1.5, 2.5])
def test_a_line_that_was_drawn_finds_the_edge_or_the_axis_of_the_bar(half: float) -> None:
    """The hand is a pixel or two beside it at either end; 0: an edge."""
    rng = np.random.default_rng(int(10 * half))
    errors = []
    for _ in range(ROUNDS):
        place, angle = rng.uniform(28, 36, 2), rng.uniform(0, np.pi)
        scene = bar(place, angle, half, (60, 200, 90)) if half else edge(place, angle, (60.0, 200.0))
        along = np.array((np.cos(angle), np.sin(angle)))
        drawn_ends = [place + s * along + rng.uniform(-1, 1) * _across(angle) for s in (-14, 14)]
        found = refine_line(drawn(scene, SIZE, rng), *drawn_ends)
        errors += ((found.xy - place) @ _across(angle) / found.sigma).tolist()
        assert 5 < np.hypot(*(found.xy[1] - found.xy[0])) < 28
    assert 0.8 < _rms(errors) < 1.2
    assert abs(np.corrcoef(errors[::2], errors[1::2])[0, 1]) < 4 / np.sqrt(ROUNDS)


@pytest.mark.parametrize("make", [noisy, textured])
def test_noise_and_texture_are_no_discs(make: type) -> None:
    rng = np.random.default_rng(8)
    accepted = 0
    for _ in range(12):
        image = make(SIZE, rng)
        with suppress(NoFitError):
            refine_disc(image, MIDDLE)
            accepted += 1
    assert accepted <= 1  # a texture holds a disc now and then


def test_noise_holds_no_edge() -> None:
    rng = np.random.default_rng(9)
    for _ in range(12):
        with pytest.raises(NoFitError, match="no edge here"):
            refine_edge(noisy(SIZE, rng), MIDDLE)
        with pytest.raises(NoFitError, match="no edge here"):
            refine_line(noisy(SIZE, rng), MIDDLE - 12, np.add(MIDDLE, (12, 5)))


def test_a_bar_is_no_disc() -> None:
    rng = np.random.default_rng(10)
    for _ in range(12):
        scene = bar(rng.uniform(30, 34, 2), rng.uniform(0, np.pi), rng.uniform(1, 3), (60, 200, 90))
        with pytest.raises(NoFitError, match=r"no disc here: .*; click nearer to its centre, or measure by hand"):
            refine_disc(drawn(scene, SIZE, rng), MIDDLE)


def test_a_bright_disc_is_not_a_dark_one() -> None:
    image = drawn(disc(MIDDLE, 5, 120), SIZE, np.random.default_rng(11))
    with pytest.raises(NoFitError, match="no disc here"):
        refine_disc(image, MIDDLE, dark=True)


@pytest.mark.parametrize("place", [(-3.0, 10.0), (10.0, SIZE + 1.0), (np.nan, 3.0)])
def test_a_place_outside_the_image_is_refused(place: tuple[float, float]) -> None:
    image = noisy(SIZE, np.random.default_rng(12))
    for refine in (refine_disc, refine_edge):
        with pytest.raises(NoFitError, match="outside the image"):
            refine(image, np.array(place))
