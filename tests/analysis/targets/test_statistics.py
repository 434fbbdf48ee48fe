"""Whole way from drawn pictures to a lens, many times: errors agree with their sigmas, and targets are found."""

import numpy as np
import pytest

from analysis.targets.calibrating import calibrate_pictures
from analysis.targets.detection import find_targets
from analysis.targets.network_of import Picture
from analysis.targets.pattern import Layout
from tests.analysis.targets.drawn import (
    Array,
    Drawing,
    DrawnCamera,
    Sheet,
    board_sheet,
    corner_places,
    frame_sheets,
    looking,
    seen_at,
    stations,
)

_DRAWS = 20
_SIZE = (480, 360)
_TARGET_MM = 110.0
_READABLE_PX = 36.0


def _camera(random: np.random.Generator) -> DrawnCamera:
    c = random.uniform(450.0, 900.0)
    edge = 240.0  # px: half the width
    third = random.choice((-1.0, 1.0)) * random.uniform(1.0, 6.0)  # px at the edge
    fifth = random.choice((0.0, 1.0)) * random.uniform(1.0, 2.0)
    x0, y0 = random.uniform(-8.0, 8.0, 2)
    return DrawnCamera(_SIZE, c, x0, y0, third / edge**3, fifth / edge**5)


def _sheets(kind: str) -> tuple[list[Sheet], Array, float]:
    """Sheets, their middle, and how far away they fill a picture whose c is its width."""
    if kind == "board":
        return [board_sheet()], np.zeros(3), 270.0
    # near enough to be read, and so flat that no target hides another's square at 35 degrees
    return frame_sheets(target_mm=_TARGET_MM, step=50.0, circles=kind == "circles"), np.array([0.0, 0.0, -75.0]), 1250.0


@pytest.mark.long
@pytest.mark.timeout(600)
@pytest.mark.parametrize("kind", ["board", "frame", "circles"])
def test_errors_of_calibrations_agree_with_their_sigmas(kind: str) -> None:
    random = np.random.default_rng(29)
    sheets, middle, away = _sheets(kind)
    places, layout = corner_places(sheets), Layout(single_mm=_TARGET_MM)
    errors: list[tuple[float, ...]] = []
    shown = found = 0
    for _ in range(_DRAWS):
        camera = _camera(random)
        drawing = Drawing(camera, noise=2.0, blur=random.uniform(0.5, 1.2), random=random)
        pictures = []
        for n, (position, rotation) in enumerate(stations(middle, away * camera.c / _SIZE[0], random, count=9)):
            sight = find_targets(drawing.picture(sheets, position, rotation), layout, f"{n}")
            pictures.append(Picture("K1", f"{n}", sight))
            visible = seen_at(camera, position, rotation, places)
            codes = [code for code in layout.codes if _readable([visible.get(str(n)) for n in layout.corners(code)])]
            shown += len(codes)
            found += sum(code in sight.targets for code in codes)
        a = calibrate_pictures(pictures, layout).calibration.outcome.adjustment
        errors.append(_errors(camera, {p.name: (p.value, p.sigma) for p in a.parameters(0)[0]}, a.parameters(0)[1]))
    assert found >= 0.95 * shown, (found, shown)
    table = np.array(errors)
    # 80 values: a normal one exceeds 2.5 in 1.2 %; the rms of 80 has a sigma of 8 %
    assert np.mean(np.abs(table) < 2.5) >= 0.95, table
    assert np.abs(table).max() < 4.0
    assert 0.8 < np.sqrt(np.mean(table**2)) < 1.2, np.sqrt(np.mean(table**2, axis=0))


def _readable(corners: list[Array | None]) -> bool:
    """Whether a picture shows the whole square, as large as the documentation asks for, foreshortened a little."""
    there = [corner for corner in corners if corner is not None]
    return bool(len(there) == 4 and min(np.linalg.norm(there[i] - there[i - 1]) for i in range(4)) > _READABLE_PX)


def _errors(camera: DrawnCamera, found: dict[str, tuple[float, float]], correlation: Array) -> tuple[float, ...]:
    """Errors over sigmas of c, x0, y0 and of the radial distortion at half the width."""
    plain = [(found[name][0] - getattr(camera, name)) / found[name][1] for name in ("c", "x0", "y0")]
    names = list(found)
    weights = np.array([{"a1": 240.0**3, "a2": 240.0**5}.get(name, 0.0) for name in names])
    sigmas = np.array([sigma for _, sigma in found.values()])
    sigma = float(np.sqrt((weights * sigmas) @ correlation @ (weights * sigmas)))
    shift = sum(w * value for w, (value, _) in zip(weights, found.values(), strict=True))
    return (*plain, (shift - camera.a1 * 240.0**3 - camera.a2 * 240.0**5) / sigma)


@pytest.mark.parametrize("kind", ["board", "frame", "circles"])
def test_corners_are_measured_to_hundredths_of_a_pixel_and_their_sigmas_say_so(kind: str) -> None:
    random = np.random.default_rng(7)
    sheets, middle, away = _sheets(kind)
    camera = DrawnCamera(_SIZE, 600.0, 3.0, -5.0, -1e-7)
    drawing, places = Drawing(camera, random=random), corner_places(sheets)
    errors, sigmas = [], []
    for along, roll in ((25.0, 10.0), (-30.0, 95.0), (5.0, 40.0)):
        pose = looking(middle, away * 1.25, along=along, up=10.0, roll=roll)
        sight = find_targets(drawing.picture(sheets, *pose), Layout(), "drawn")
        for name, place in seen_at(camera, *pose, places).items():
            if (corner := sight.corners.get(name)) is not None:
                errors.append((corner.x - place[0], corner.y - place[1]))
                sigmas.append((corner.sigma_x, corner.sigma_y))
    rms = float(np.sqrt(np.mean(np.square(errors))))
    assert len(errors) > 90
    assert rms < 0.02
    assert np.abs(np.mean(errors, axis=0)).max() < 3.0 * rms / np.sqrt(len(errors))
    assert 0.8 < float(np.sqrt(np.mean(np.square(np.divide(errors, sigmas))))) < 1.25
