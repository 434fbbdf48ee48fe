"""The kinogram: right places, right points in the pictures, nothing invented, marks that are no chance."""

import json
import re
from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from html import unescape
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from analysis.report.course import course_of
from analysis.report.figures import five_figures
from analysis.report.kinogram.drawing import draw
from analysis.report.kinogram.earlier import EarlierJump, read_earlier
from analysis.report.kinogram.figures import Mark, Word, marks_of, reference_of
from analysis.report.kinogram.folder import write_kinograms
from analysis.report.kinogram.shots import PLACES_M, WIDTH, Missing, Shot, brightened, moments_of, shots_of
from analysis.report.overlay import Overlay
from analysis.result.model import Jump, MeasuredRecording, Quantity, Verdict
from analysis.scene.camera_system import PlacedCamera
from rig.arrays import Floats
from rig.errors import BadInputError
from rig.phrase import phrase
from tests.analysis.report.jumps import JUMP_SEED, jump_log, measured_recording, measurements
from tests.analysis.result.recordings import model, without_takeoff
from tests.analysis.simulated import RATE_HZ, true_cameras

BEFORE = datetime(2026, 2, 1, tzinfo=UTC)
NASTY = {"athlete": "Bjørn </main><b>Ås</b>", "bib": '1"7', "gate": "12"}


@pytest.fixture(scope="module")
def log() -> Path:
    """The log of the jump, with an image of every pulse."""
    return jump_log(1)


@pytest.fixture(scope="module")
def shots(log: Path) -> list[Shot]:
    """The five pictures."""
    return _shots(measured_recording().jumps[0], log)


def _shots(jump: Jump, log: Path) -> list[Shot]:
    return shots_of(course_of(jump, RATE_HZ), measurements().jumps[0], true_cameras(), log)


def _written(result: MeasuredRecording, log: Path, folder: Path, earlier: Sequence[EarlierJump] = ()) -> dict[str, Any]:
    write_kinograms(
        result, measurements(), true_cameras(), log, folder, perpendicular={1: Quantity(2.3, 0.08)}, earlier=earlier
    )
    return json.loads((folder / "kinogram.json").read_text(encoding="utf-8"))  # type: ignore[no-any-return]


def _text(page: str) -> str:
    """What a person reads."""
    return " ".join(unescape(re.sub(r"<style>.*?</style>|<[^>]*>", " ", page)).split())


def test_very_dark_pictures_are_brightened_all_alike_and_others_stay(shots: list[Shot]) -> None:
    assert brightened(shots) == shots
    dark = [replace(shot, picture=None if shot.picture is None else shot.picture // 8) for shot in shots]
    dark[0] = Shot(PLACES_M[0], Missing.NO_PICTURE)
    lit = brightened(dark)
    assert lit[0] is dark[0]
    curve: dict[int, int] = {}
    for before, after in zip(dark[1:], lit[1:], strict=True):
        assert before.picture is not None
        assert after.picture is not None
        assert float(np.median(after.picture)) > 3 * float(np.median(before.picture))
        for grey, lighter in zip(before.picture.ravel().tolist(), after.picture.ravel().tolist(), strict=True):
            assert curve.setdefault(grey, lighter) == lighter, "one curve for all"
    assert sorted(curve, key=curve.__getitem__) == sorted(curve)


def test_each_picture_is_of_the_pulse_that_is_nearest_to_its_place(shots: list[Shot]) -> None:
    truth = model(JUMP_SEED).truth
    start = truth.pose(truth.takeoff_pulse).origin
    away = {pulse: float(np.hypot(*(truth.pose(pulse).origin - start)[:2])) for pulse in range(25, 62)}
    for shot in shots:
        assert shot.moment is not None
        off = {p: abs(d - shot.place_m) for p, d in away.items() if truth.since_takeoff(p) > -0.02}
        assert off[shot.moment.pulse] < min(off.values()) + 0.02  # two may be equally near
        assert abs(shot.moment.distance_m - away[shot.moment.pulse]) < 0.02
    assert [shot.place_m for shot in shots] == list(PLACES_M)


def test_drawn_points_lie_on_the_markers_of_the_picture(shots: list[Shot]) -> None:
    """In the picture each marker is a bright disc of 0.1 m; where its middle is needs no camera to be known."""
    found = 0
    for shot in shots:
        assert shot.picture is not None
        assert shot.overlay is not None
        assert shot.px_per_m is not None
        drawn = {name: xy for name, (xy, _) in shot.overlay.ellipses.items()}
        reach = 0.09 * shot.px_per_m
        for name, (x, y) in drawn.items():
            others = [np.hypot(*(xy - (x, y))) for other, xy in drawn.items() if other != name]
            if min(others) < 2.5 * reach or name in {"P3", "P4"}:  # skis are as bright as the markers on them
                continue
            rows, columns = np.mgrid[: shot.picture.shape[0], : shot.picture.shape[1]]
            near = np.hypot(columns - x, rows - y) < reach
            bright = near & (shot.picture > (float(shot.picture[near].max()) + float(shot.picture[near].min())) / 2)
            assert np.hypot(columns[bright].mean() - x, rows[bright].mean() - y) < 2.0, (shot.place_m, name)
            found += 1
    assert found >= 8


def test_points_and_skis_are_where_the_truth_is_and_all_pictures_have_one_scale(shots: list[Shot]) -> None:
    truth = model(JUMP_SEED).truth
    scales = set()
    for shot in shots:
        assert shot.moment is not None
        assert shot.overlay is not None
        assert shot.camera is not None
        assert shot.px_per_m is not None
        pose, camera = truth.pose(shot.moment.pulse), true_cameras()[shot.camera]
        larger = shot.px_per_m / _px_per_m(camera, pose.markers.mean(axis=0))
        hip = camera.project(pose.markers[1])
        half = truth.ski_length / 2
        tips = {side: pose.markers[2 + s] + half * pose.skis[s] for s, side in enumerate(("right", "left"))}
        tails = {side: pose.markers[2 + s] - half * pose.skis[s] for s, side in enumerate(("right", "left"))}
        drawn_hip = shot.overlay.ellipses["P2"][0]
        for name, xyz in zip(("P1", "P3", "P4"), pose.markers[[0, 2, 3]], strict=True):
            should = drawn_hip + (camera.project(xyz) - hip) * larger
            assert np.hypot(*(shot.overlay.ellipses[name][0] - should)) < 5.0, (shot.place_m, name)
        for side in ("right", "left"):
            line = shot.overlay.lines[side]
            for end, xyz in ((line[0], tails[side]), (line[-1], tips[side])):
                assert np.hypot(*(end - drawn_hip - (camera.project(xyz) - hip) * larger)) < 8.0, (shot.place_m, side)
        scales.add(shot.px_per_m)
    assert len(scales) == 1
    assert 100 < scales.pop() < WIDTH / 2.63


def _px_per_m(camera: PlacedCamera, xyz: Floats) -> float:
    """Found by moving the place by a millimetre in both directions across the ray."""
    ray = (xyz - camera.position) / np.linalg.norm(xyz - camera.position)
    across = np.cross(ray, (0.0, 0.0, 1.0))
    across /= np.linalg.norm(across)
    sides = np.stack(
        [camera.project(xyz + 1e-3 * step) - camera.project(xyz) for step in (across, np.cross(ray, across))]
    )
    return float(np.sqrt(abs(np.linalg.det(sides)))) * 1e3


def test_what_was_not_measured_is_missing(log: Path, tmp_path: Path) -> None:
    result = measured_recording()
    (jump,) = result.jumps
    course = course_of(jump, RATE_HZ)
    near = replace(jump, pulses=tuple(p for p, d in zip(jump.pulses, course.distance, strict=True) if d < 13))
    missing = [shot.missing for shot in _shots(near, log)]
    assert missing == [None, None, None, Missing.NOT_MEASURED, Missing.NOT_MEASURED]
    gap = tuple(
        replace(p, smoothed=None) if abs(d - 10) < 1.5 else p for p, d in zip(jump.pulses, course.distance, strict=True)
    )
    there = [moment is not None for moment in moments_of(course_of(replace(jump, pulses=gap), RATE_HZ))]
    assert there == [True, True, False, True, True]
    late = replace(jump, pulses=jump.pulses[-20:])  # he came into sight behind the edge
    assert moments_of(course_of(late, RATE_HZ)) == [None] * 5
    content = _written(replace(result, jumps=(near,)), log, tmp_path)
    assert [place["pulse"] is None for place in content["jumps"][0]["places"]] == [False] * 3 + [True] * 2
    page = (tmp_path / "kinogram.html").read_text(encoding="utf-8")
    assert page.count("<image ") == 3
    assert _text(page).count("not measured here ikke målt her") == 2
    assert content["jumps"][0]["figures"]["speed_20_m"] is None

    content = _written(without_takeoff(result), log, tmp_path)
    assert [place["missing"] for place in content["jumps"][0]["places"]] == ["not measured"] * 5
    assert "<image " not in (tmp_path / "kinogram.html").read_text(encoding="utf-8")
    assert cv2.imread(str(tmp_path / "kinogram.jpg")) is not None


def test_a_place_without_a_frame_has_no_picture_of_another_pulse(jump_log: Path, tmp_path: Path) -> None:
    content = _written(measured_recording(), jump_log, tmp_path)  # this log has a frame of every fourth pulse only
    places = content["jumps"][0]["places"]
    assert [place["missing"] for place in places] == ["no picture"] * 5
    assert all(place["pulse"] is not None and place["camera"] is None for place in places)
    assert "no picture of him here ikke noe bilde her" in _text((tmp_path / "kinogram.html").read_text("utf-8"))


def test_another_camera_is_taken_where_the_best_one_delivered_nothing(shots: list[Shot]) -> None:
    best = shots[2].camera
    assert best is not None
    others = _shots(measured_recording().jumps[0], jump_log(1, lost=best))
    assert best not in {shot.camera for shot in others}
    assert others[2].moment is not None
    assert shots[2].moment is not None
    assert others[2].moment.pulse == shots[2].moment.pulse


def test_the_page_needs_nothing_and_says_it_in_both_languages(log: Path, tmp_path: Path) -> None:
    result = replace(measured_recording(), session=NASTY)
    _written(result, log, tmp_path)
    page = (tmp_path / "kinogram.html").read_text(encoding="utf-8")
    assert len(page.encode()) < 600_000
    assert "<script" not in page
    assert not re.search(r"(?:src|href)=\"(?!data:image/webp;base64,)", page)
    assert "default-src 'none'; img-src data:" in page
    assert page.count("<image ") == 5
    text = _text(page)
    assert 'Bjørn </main><b>Ås</b> bib 1"7 startnr. 1"7' in text
    assert "<b>Ås" not in page
    assert "gate 12 bom 12" in text
    assert "Measured well Godt målt" in text
    assert "Take-off speed Fart på kanten" in text
    picture = cv2.imread(str(tmp_path / "kinogram.jpg"))
    assert picture is not None
    assert picture.shape[1] == 1080
    assert (tmp_path / "kinogram.jpg").stat().st_size < 600_000


def test_figures_are_those_of_the_coachs_page_and_at_most_seven(log: Path, tmp_path: Path) -> None:
    result = measured_recording()
    figures = _written(result, log, tmp_path)["jumps"][0]["figures"]
    five = five_figures(course_of(result.jumps[0], RATE_HZ), Quantity(2.3, 0.08))
    assert len(figures) == 7
    for figure, value in zip(five, figures.values(), strict=False):
        assert figure.quantity is not None
        assert value == {"value": figure.quantity.value, "sigma": figure.quantity.sigma}
    text = _text((tmp_path / "kinogram.html").read_text(encoding="utf-8"))
    speeds = [each.quantity for each in (five[0], five[2]) if each.quantity is not None]
    assert re.findall(r"([0-9.]+) km/h", text) == [f"{3.6 * speed.value:.1f}" for speed in speeds]
    assert text.count("±") == 7 + 2  # what the sign means, in both languages


@pytest.mark.parametrize("grey", [0, 70, 128, 200, 255])
def test_lines_and_points_are_seen_on_any_background(grey: int) -> None:
    picture = np.full((100, 200, 3), grey, np.uint8)
    along = np.stack((np.linspace(20, 180, 9), np.full(9, 50.0)), axis=1)
    point = {"P1": (np.array((100.0, 50.0)), np.eye(2))}
    draw(picture, Overlay({"left": along}, point, {}, {}, frozenset()))
    for column in (60, 100):
        across = cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)[:, column].astype(int)
        assert across.min() < 40
        assert across.max() > 200
        colour = picture[50, column].astype(int)
        assert np.ptp(colour) > 100  # the line's own colour is within the edges


def _earlier(day: int, ok: bool = True, **figures: float) -> EarlierJump:
    values = {name: Quantity(value, 0.01) for name, value in figures.items()}
    return EarlierJump(f"r{day}", "A", BEFORE - timedelta(days=day), ok, values)


def test_the_ten_best_are_the_fastest_before_that_can_be_trusted() -> None:
    jumps = [_earlier(day, takeoff_speed=20.0 + day) for day in range(1, 16)]
    jumps += [_earlier(20, ok=False, takeoff_speed=90.0), _earlier(-3, takeoff_speed=91.0), _earlier(21, v_angle=3.0)]
    reference = reference_of(jumps, BEFORE)
    assert reference.by_speed
    assert [jump.recording for jump in reference.jumps] == [f"r{day}" for day in range(15, 5, -1)]
    latest = reference_of([_earlier(day, v_angle=20.0) for day in range(1, 16)], BEFORE)
    assert not latest.by_speed
    assert [jump.recording for jump in latest.jumps] == [f"r{day}" for day in range(1, 11)]


def _marks(own: float, sigma: float = 0.01, name: str = "takeoff_speed", n: int = 10) -> Mark | None:
    figures = [{"takeoff_speed": 26.0} | {name: 26.0 + 0.1 * (-1) ** day} for day in range(n)]
    jumps = [_earlier(day, **of_day) for day, of_day in enumerate(figures, 1)]
    return marks_of({name: Quantity(own, sigma)}, reference_of(jumps, BEFORE)).get(name)


@pytest.mark.parametrize(
    ("name", "own", "sigma", "word"),
    [
        ("takeoff_speed", 26.6, 0.01, Word.BETTER),
        ("perpendicular", 25.4, 0.01, Word.WORSE),
        ("v_angle", 26.6, 0.01, Word.HIGHER),
        ("speed_20_m", 25.4, 0.01, Word.LOWER),
        ("takeoff_speed", 26.1, 0.01, Word.NOISE),
        ("takeoff_speed", 26.6, 0.5, Word.NOISE),  # it is not known well enough
    ],
)
def test_a_mark_says_better_only_where_that_is_known(name: str, own: float, sigma: float, word: Word) -> None:
    mark = _marks(own, sigma, name)
    assert mark is not None
    assert (mark.word, mark.jumps) == (word, 10)
    assert mark.difference == pytest.approx(own - 26.0)


def test_two_earlier_jumps_tell_nothing() -> None:
    assert _marks(30.0, n=2) is None
    assert _marks(30.0, n=3) is not None


@pytest.mark.parametrize("n", [3, 10])
def test_of_jumps_alike_one_in_twenty_gets_a_mark(n: int) -> None:
    rng = np.random.default_rng(n)
    names = ["takeoff_speed", "perpendicular", "speed_20_m", "angle_of_attack", "ski_to_body", "v_angle", "height_20_m"]
    draws, marked = 600, 0
    for _ in range(draws):
        values = rng.standard_normal((n + 1, 7)) * 0.1 + 26.0  # of the same athlete on the same day
        jumps = [_earlier(day, **dict(zip(names, row, strict=True))) for day, row in enumerate(values[1:], 1)]
        own = {name: Quantity(float(value), 0.001) for name, value in zip(names, values[0], strict=True)}
        marks = marks_of(own, reference_of(jumps, BEFORE))
        assert len(marks) == 7
        marked += any(mark.word is not Word.NOISE for mark in marks.values())
    assert marked / draws < 0.05 + 3 * np.sqrt(0.05 * 0.95 / draws)
    assert marked > 0


def test_marks_stand_on_the_page_and_a_doubtful_jump_has_none(log: Path, tmp_path: Path) -> None:
    result = measured_recording()
    first = _written(result, log, tmp_path)
    assert first["jumps"][0]["marks"] == {}
    assert "No earlier jumps to compare with." in _text((tmp_path / "kinogram.html").read_text(encoding="utf-8"))
    (own,) = read_earlier(tmp_path)
    assert own.figures["takeoff_speed"].value == first["jumps"][0]["figures"]["takeoff_speed"]["value"]
    assert (own.athlete, own.ok) == ("A. Jumper", True)
    slower = [
        replace(
            own,
            time=own.time - timedelta(days=day),
            figures={**own.figures, "takeoff_speed": Quantity(24.0 + 0.1 * day, 0.01)},
        )
        for day in range(1, 4)
    ]
    for name in ("next", "few"):
        (tmp_path / name).mkdir()
    content = _written(result, log, tmp_path / "next", slower)
    assert content["jumps"][0]["marks"]["takeoff_speed"]["word"] == "better"
    few = _written(result, log, tmp_path / "few", slower[:2])
    assert few["jumps"][0]["marks"] == {}
    assert "Earlier jumps: 2, too few" in _text((tmp_path / "few" / "kinogram.html").read_text(encoding="utf-8"))
    assert content["jumps"][0]["marks"]["v_angle"]["word"] == "within noise"
    text = _text((tmp_path / "next" / "kinogram.html").read_text(encoding="utf-8"))
    assert re.search(r"better \+\d\.\d+ bedre", text)
    assert "the athlete's 3 fastest earlier jumps" in text
    doubtful = replace(result.jumps[0], verdict=_verdict())
    content = _written(replace(result, jumps=(doubtful,)), log, tmp_path / "next", slower)
    assert content["jumps"][0]["marks"] == {}
    text = _text((tmp_path / "next" / "kinogram.html").read_text(encoding="utf-8"))
    assert "Doubtful: do not rely on it Usikkert: ikke stol på det the take-off was not found" in text
    assert "satsen ble ikke funnet" in text
    assert "Not compared" in text


def _verdict() -> Verdict:
    no = phrase("jump_no_takeoff", "the take-off was not found, so that time counts from the first pulse")
    return Verdict(False, str(no), {}, (no,))


def test_several_jumps_have_a_picture_each_and_share_the_page(log: Path, tmp_path: Path) -> None:
    result = measured_recording()
    twice = replace(result, jumps=(result.jumps[0], replace(result.jumps[0], number=2)))
    content = _written(twice, log, tmp_path)
    assert [jump["number"] for jump in content["jumps"]] == [1, 2]
    assert sorted(p.name for p in tmp_path.iterdir()) == [
        *("kinogram-2.jpg", "kinogram.html", "kinogram.jpg", "kinogram.json")
    ]
    page = (tmp_path / "kinogram.html").read_text(encoding="utf-8")
    assert page.count("<section>") == 2
    assert len(page.encode()) < 600_000


@pytest.mark.parametrize(
    "content", ["", "[]", '{"format": "svev-jumper/1", "recording": "", "jumps": []}', '{"format": "svev-kinogram/1"}']
)
def test_what_is_no_kinogram_is_refused(content: str, tmp_path: Path) -> None:
    (tmp_path / "kinogram.json").write_text(content)
    with pytest.raises(BadInputError, match="svev analyze"):
        read_earlier(tmp_path)
    with pytest.raises(BadInputError, match="no such file"):
        read_earlier(tmp_path / "nowhere")
