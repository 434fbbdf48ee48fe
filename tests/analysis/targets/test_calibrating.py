"""From corners to a calibration: what is found out, left out, and advised. Corners are computed, with errors."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from analysis.targets.calibrating import PictureCalibration, calibrate_pictures
from analysis.targets.detection import Corner, Sight
from analysis.targets.network_of import MeasuredDistance, Picture
from analysis.targets.pattern import Layout
from analysis.targets.report import report, to_json
from photogrammetry.reports.document import as_html, as_text
from rig.errors import BadInputError
from tests.analysis.targets.drawn import (
    EXACT,
    Array,
    DrawnCamera,
    Sheet,
    board_sheet,
    corner_places,
    frame_sheets,
    looking,
    seen_at,
    stations,
)

_SIGMA = 0.01
_CAMERA = DrawnCamera((480, 360), 600.0, 4.0, -3.0, -2e-7)
_MIDDLE = np.array([0.0, 0.0, -200.0])


def _pictures(
    poses: Sequence[tuple[Array, Array]],
    places: Callable[[int], dict[str, Array]],
    camera: DrawnCamera = _CAMERA,
    name: str = "K1",
    sigma: float = _SIGMA,
) -> list[Picture]:
    random = np.random.default_rng(4)
    pictures = []
    for n, pose in enumerate(poses):
        seen = seen_at(camera, *pose, places(n))
        corners = {key: _corner(at + random.normal(0.0, sigma, 2), sigma) for key, at in seen.items()}
        codes = dict.fromkeys({int(key[1:-1]) for key in corners if key.startswith("T")}, np.zeros((4, 2)))
        pictures.append(Picture(name, f"{name}/{n}", Sight(camera.size, corners, codes, (), mirrored=False, blur=0.8)))
    return pictures


def _corner(at: Array, sigma: float) -> Corner:
    return Corner(float(at[0]), float(at[1]), sigma, sigma, EXACT)


def _frame() -> dict[str, Array]:
    return corner_places(frame_sheets())


def _calibrated(pictures: Sequence[Picture], *distances: MeasuredDistance, flat: bool = False) -> PictureCalibration:
    return calibrate_pictures(pictures, Layout(), distances, flat=flat)


def _stations(sheets: Sequence[Sheet] = (), camera: DrawnCamera = _CAMERA) -> list[tuple[Array, Array]]:
    middle, away = (_MIDDLE, 1250.0) if not sheets else (np.zeros(3), 270.0)
    return stations(middle, away * camera.c / camera.size[0], np.random.default_rng(8), count=12)


def test_a_frame_of_unknown_targets_gives_the_lens() -> None:
    places = _frame()
    made = _calibrated(_pictures(_stations(), lambda _: places))
    a = made.calibration.outcome.adjustment
    found = {p.name: p for p in a.parameters(0)[0]}
    for name in ("c", "x0", "y0", "a1"):
        assert abs(found[name].value - getattr(_CAMERA, name)) < 3.0 * found[name].sigma
    assert 0.9 < a.ratio < 1.1
    for name in ("a2", "b1", "b2"):  # there is none, and it is estimated all the same, since any lens may have some
        assert abs(found[name].value) < 3.0 * found[name].sigma
    (verdict,) = made.verdicts
    assert verdict.good
    assert "good enough for 1:1000" in verdict.words
    assert verdict.advice == ()
    assert not any("left out" in note for note in made.notes)


def test_the_board_is_not_taken_as_flat_unless_one_says_so() -> None:
    bent = corner_places([board_sheet()])
    bent = {name: at + np.array([0.0, 0.0, 4e-4 * at[0] ** 2]) for name, at in bent.items()}  # 4 mm at its sides
    pictures = _pictures(_stations([board_sheet()]), lambda _: bent)
    made = _calibrated(pictures)
    a = made.calibration.outcome.adjustment
    c = a.parameters(0)[0][0]
    assert abs(c.value - _CAMERA.c) < 3.0 * c.sigma
    assert any("the board bends by" in note for note in made.notes)
    plane = corner_places([board_sheet()])
    straight = _pictures(_stations([board_sheet()]), lambda _: plane)
    free, flat = (_calibrated(straight, flat=said).calibration.outcome.adjustment for said in (False, True))
    assert flat.parameters(0)[0][0].sigma < free.parameters(0)[0][0].sigma
    assert np.abs(flat.state.xyz[:, 2]).max() < 0.1


def test_a_measured_distance_gives_the_scale_and_tells_a_shrunken_print() -> None:
    places = _frame()
    shrunk = {name: 0.95 * at for name, at in places.items()}
    poses = [(0.95 * position, rotation) for position, rotation in _stations()]
    length = float(np.linalg.norm(shrunk["T100a"] - shrunk["T115c"]))
    made = _calibrated(_pictures(poses, lambda _: shrunk), MeasuredDistance("T100a", "T115c", length, 0.3))
    a = made.calibration.outcome.adjustment
    at = {point.name: xyz for point, xyz in zip(a.network.points, a.state.xyz, strict=True)}
    assert np.linalg.norm(at["T100a"] - at["T100b"]) == pytest.approx(0.95 * 80.0, abs=0.1)
    assert any(note.startswith("the prints have 95.0% of their nominal size") for note in made.notes)
    with pytest.raises(BadInputError, match="corner T199a is in fewer than two pictures"):
        _calibrated(_pictures(poses, lambda _: shrunk), MeasuredDistance("T100a", "T199a", length, 0.3))


def test_a_target_that_moved_is_named_and_left_out() -> None:
    before, after = _frame(), _frame()
    for letter in "abcd":
        after[f"T106{letter}"] = after[f"T106{letter}"] + np.array([6.0, 2.0, 0.0])
    made = _calibrated(_pictures(_stations(), lambda n: before if n < 6 else after))
    moved = [note for note in made.notes if "moved on the frame" in note]
    assert len(moved) == 1
    assert moved[0].startswith("target 106 is left out")
    c = made.calibration.outcome.adjustment.parameters(0)[0][0]
    assert abs(c.value - _CAMERA.c) < 3.0 * c.sigma


def test_a_target_that_another_one_hides_in_part_has_not_moved() -> None:
    places = _frame()
    pictures = _pictures(_stations(), lambda _: places)
    for n in (2, 5, 8):  # the edge of a sheet beside two of its corners: they are measured beside themselves
        corners = dict(pictures[n].sight.corners)
        for name in ("T106a", "T106b"):
            corners[name] = replace(corners[name], x=corners[name].x + 1.5)
        pictures[n] = replace(pictures[n], sight=replace(pictures[n].sight, corners=corners))
    made = _calibrated(pictures)
    (note,) = [note for note in made.notes if "106" in note]
    assert note.startswith("target 106: what does not fit its other pictures is left out: ")
    for corner in ("T106a in K1/2", "T106b in K1/2", "T106a in K1/5", "T106b in K1/8"):
        assert corner in note
    assert "nothing hides a part of it" in note
    c = made.calibration.outcome.adjustment.parameters(0)[0][0]
    assert abs(c.value - _CAMERA.c) < 3.0 * c.sigma


def test_cameras_of_one_frame_are_adjusted_together() -> None:
    places = _frame()
    other = replace(_CAMERA, size=(640, 480), c=1100.0, a1=1e-7)
    pictures = _pictures(_stations(), lambda _: places)
    pictures += _pictures(_stations(camera=other), lambda _: places, other, "K2")
    made = _calibrated(pictures)
    a = made.calibration.outcome.adjustment
    for i, camera in enumerate((_CAMERA, other)):
        c = a.parameters(i)[0][0]
        assert abs(c.value - camera.c) < 3.0 * c.sigma
    assert [verdict.camera for verdict in made.verdicts] == ["K1", "K2"]
    assert set(to_json(made)["verdicts"]) == {"K1", "K2"}


def test_pictures_that_all_look_alike_are_not_good_enough_and_it_says_what_to_do() -> None:
    places = corner_places([board_sheet()])
    ways = [(4.0, 0.0), (0.0, 4.0), (-4.0, 0.0), (0.0, -4.0), (3.0, 3.0), (0.0, 0.0)]
    poses = [looking(np.zeros(3), 700.0, along=along, up=up, roll=0.0) for along, up in ways]
    (verdict,) = _calibrated(_pictures(poses, lambda _: places, sigma=0.05)).verdicts
    assert not verdict.good
    assert "NOT good enough for 1:1000" in verdict.words
    advice = " / ".join(map(str, verdict.advice))
    for words in (
        "take more pictures: 6 of 9",
        "fill the picture: targets cover",
        "from more to the side",
        "turn the camera by 90 degrees for two more pictures: principal point and pose are not apart",
    ):
        assert words in advice


def test_blurred_pictures_are_named() -> None:
    places = _frame()
    pictures = _pictures(_stations(), lambda _: places)
    pictures[3] = replace(pictures[3], sight=replace(pictures[3].sight, blur=2.4))
    (verdict,) = _calibrated(pictures).verdicts
    assert tuple(map(str, verdict.advice)) == ("take K1/3 again: blurred (edges 2.4 px wide, usual 0.8)",)
    for n, picture in enumerate(pictures):  # all are sharp, some sharper than lenses are
        pictures[n] = replace(picture, sight=replace(picture.sight, blur=0.6 if n == 3 else 0.3))
    (verdict,) = _calibrated(pictures).verdicts
    assert verdict.advice == ()


@pytest.mark.parametrize(
    ("other", "odd"),
    [
        (replace(_CAMERA, c=612.0), [6, 7, 8, 9, 10, 11]),  # the focus was changed in the middle
        (replace(_CAMERA, c=780.0), [9, 10, 11]),  # the zoom, before the last ones
        (replace(_CAMERA, c=780.0), [1, 4, 7, 9]),  # of two cameras, their files named by the time
        (replace(_CAMERA, x0=-6.0, y0=5.0), [8, 9, 10, 11]),  # of two cameras of one model
    ],
)
def test_pictures_of_two_lenses_in_one_folder_are_refused_and_named(other: DrawnCamera, odd: list[int]) -> None:
    places = _frame()
    one, two = (_pictures(_stations(), lambda _: places, camera) for camera in (_CAMERA, other))
    with pytest.raises(BadInputError, match="pictures of two lenses") as refused:
        _calibrated([(two if n in odd else one)[n] for n in range(12)])
    names = str(refused.value).partition(" px in ")[2].partition(", and ")[0].split(", ")
    assert names in ([f"K1/{n}" for n in odd], [f"K1/{n}" for n in range(12) if n not in odd])


def test_a_single_picture_of_another_lens_is_left_out() -> None:
    places = _frame()
    other = replace(_CAMERA, c=1200.0)
    pictures = _pictures(_stations(), lambda _: places)
    pictures[3] = _pictures(_stations(), lambda _: places, other)[3]
    made = _calibrated(pictures)
    assert made.notes[0].startswith("K1/3 is left out: it contradicts all others: zoom or focus was another one")
    assert len(made.pictures) == 11
    c = made.calibration.outcome.adjustment.parameters(0)[0][0]
    assert abs(c.value - _CAMERA.c) < 3.0 * c.sigma


def test_prints_that_were_stretched_to_fit_the_page_spoil_nothing() -> None:
    """The printer made them 3 % shorter across and 1 % longer along; nobody has measured the check line."""
    stretched = {name: at * (0.97, 1.01, 1.0) for name, at in corner_places([board_sheet()]).items()}
    a = _calibrated(
        _pictures(_stations([board_sheet()]), lambda _: stretched), flat=True
    ).calibration.outcome.adjustment
    found = {p.name: p for p in a.parameters(0)[0]}
    for name in ("c", "x0", "y0", "a1"):
        assert abs(found[name].value - getattr(_CAMERA, name)) < 3.0 * found[name].sigma


@pytest.mark.parametrize(("count", "words"), [(1, "1 picture shows"), (2, "2 pictures show")])
def test_too_few_pictures_are_refused(count: int, words: str) -> None:
    places = _frame()
    with pytest.raises(BadInputError, match=f"{words} the targets|no corner is in two pictures"):
        _calibrated(_pictures(_stations()[:count], lambda _: places))


def test_pictures_of_one_pose_are_refused() -> None:
    places = _frame()
    pose = looking(_MIDDLE, 1600.0, along=10.0, up=5.0, roll=0.0)
    with pytest.raises(BadInputError, match="all 5 pictures are of one pose"):
        _calibrated(_pictures([pose] * 5, lambda _: places))


def test_a_picture_of_other_targets_is_left_out() -> None:
    places = _frame()
    alone = {name.replace("T1", "T2"): at for name, at in places.items()}
    made = _calibrated(_pictures(_stations(), lambda n: alone if n == 5 else places))
    assert len(made.pictures) == 11
    assert "K1/5 is left out: its targets cannot be joined" in made.notes[0]


def test_a_picture_whose_targets_one_other_shows_is_left_out() -> None:
    """Two pictures alone do not tell how large what they show is, and nothing would be determined."""
    places = _frame()
    corner = {name: at for name, at in places.items() if name[:-1] in {"T105", "T106", "T109"}}
    others = {name: at for name, at in places.items() if name not in corner}
    made = _calibrated(_pictures(_stations(), lambda n: corner if n == 5 else places if n == 4 else others))
    assert len(made.pictures) == 11
    assert made.notes[0].startswith("K1/5 is left out: no two other pictures show its targets")


def test_the_report_has_verdict_coverage_residuals_and_grid() -> None:
    places = _frame()
    made = report(_calibrated(_pictures(_stations(), lambda _: places)))
    text, page = as_text(made), as_html(made)
    assert text.index("Verdict") < text.index("good enough for 1:1000") < text.index("Pictures")
    for words in ("all corners of 12 pictures", "a square grid as the lens shows it", "mean residual in each"):
        assert words in page
