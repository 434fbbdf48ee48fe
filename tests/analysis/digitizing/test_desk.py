"""An operator measures a jump: what follows in space is true, also while he drags, and nothing of it is lost."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analysis.cameras.source import read_source
from analysis.digitizing.desk import Desk
from analysis.digitizing.files import DeskFiles
from analysis.digitizing.geometry.epipolar import epipolar_curves
from analysis.digitizing.marks.journal import Entered, Key
from analysis.measurements.file import write_measurements
from analysis.scene.camera_system import CameraSystem
from bench.analysis.hill_logs import HillLog
from photogrammetry.geometry.camera_model import INTERIOR
from rig.api.digitizing import PlaceAction, StateAction, TapeOrder, TrackOrder, UndoAction
from rig.errors import BadInputError, StateForbidsError
from tests.analysis.digitizing.hill import MEASURED, PATIENCE_S, Oriented, adopt, clicks, opened
from tests.support.waiting import wait_until


@pytest.mark.long
def test_points_skis_and_angles_that_were_clicked_are_true(desk: Desk, jump: HillLog) -> None:
    for click in clicks(desk, jump, seed=3):
        changed = desk.act("Anna", click.action())
        assert changed.view is not None
    errors: list[float] = []
    sides: list[bool | None] = []
    for pulse in MEASURED:
        view, truth = desk.view("Anna", pulse), jump.truth[pulse]
        for name, point in view.space.items():
            if point.X is not None and point.sigma is not None:
                errors += ((np.array(point.X) - truth["points"][name]) / point.sigma).tolist()
        for name, estimate in view.figures.items():
            true = truth["height"] if name == "height" else truth["angles"][name]
            assert abs(estimate.value - true) < 5 * estimate.sigma, (pulse, name)
        sides += [line.sides.ok for line in view.lines.values() if line.sides is not None]
    assert len(errors) > 100
    assert True in sides
    assert False not in sides
    assert 0.6 < np.sqrt(np.mean(np.square(errors))) < 1.3
    assert _computed_angles_are_true(desk, jump)


def _computed_angles_are_true(desk: Desk, jump: HillLog) -> bool:
    desk.programs.compute("Anna")
    wait_until(lambda: desk.programs.computing.result("Anna").state != "computing", "the jump is computed", 60)
    result = desk.programs.computing.result("Anna")
    assert result.state == "done", result.problem
    assert "report.html" in result.files
    found = desk.programs.computing.file("Anna", "jumper.json")
    assert found is not None
    pulses = json.loads(found.read_text())["jumps"][0]["pulses"]
    statuses = {point["status"] for pulse in pulses for point in pulse["points"].values() if point is not None}
    assert statuses == {"by hand"}
    alphas = {pulse["pulse"]: (pulse["smoothed"] or {"angles": {"alpha": None}})["angles"]["alpha"] for pulse in pulses}
    off = [
        abs(alpha["value"] - jump.truth[pulse]["angles"]["alpha"]) / alpha["sigma"]
        for pulse, alpha in alphas.items()
        if alpha is not None
    ]
    return len(off) > 10 and max(off) < 5


def test_a_wrong_click_is_named_and_the_worst_one_is_told_first(desk: Desk, jump: HillLog) -> None:
    wrong = next(click for click in clicks(desk, jump, 4, range(20, 21)) if (click.camera, click.thing) == ("K2", "P3"))
    for click in clicks(desk, jump, 4, range(20, 21)):
        desk.act("Anna", click.action())
    assert desk.view("Anna", 20).space["P3"].finding is None
    x, y = wrong.xy
    moved = PlaceAction(do="place", pulse=20, camera="K2", thing="P3", xy=(x + 6, y - 12))
    view = desk.act("Anna", moved).view
    assert view is not None
    finding = view.space["P3"].finding
    assert finding is not None
    assert finding.text.startswith("K2's P3 does not fit: ")
    assert "px, w = " in finding.text
    worst = desk.session_view("Anna").worst[0]
    assert (worst.pulse, worst.camera, worst.thing) == (20, "K2", "P3")


def test_the_worst_ray_of_a_pulse_that_nobody_looked_at_is_told_after_each_change(desk: Desk, jump: HillLog) -> None:
    marks = [(Key(c.pulse, c.camera, c.thing), Entered(xy=c.xy)) for c in clicks(desk, jump, 4) if c.thing == "P3"]
    desk.put("Anna", marks)
    assert not [each for each in desk.session_view("Anna").worst if each.w > 5]
    key, entered = next((key, entered) for key, entered in marks if (key.pulse, key.camera) == (20, "K2"))
    assert entered.xy is not None
    desk.put("Anna", [marks[0], (key, Entered(xy=(entered.xy[0] + 6, entered.xy[1] - 12)))])
    worst = desk.session_view("Anna").worst[0]
    assert (worst.pulse, worst.camera, worst.thing) == (20, "K2", "P3")
    desk.put("Anna", [marks[0], (key, entered)])
    assert not [each for each in desk.session_view("Anna").worst if each.w > 5]


def test_a_view_is_the_same_whatever_was_computed_before(desk: Desk, jump: HillLog) -> None:
    for click in clicks(desk, jump, 4, range(18, 21)):
        desk.act("Anna", click.action())
    before = desk.view("Anna", 20)
    wrong = PlaceAction(do="place", pulse=20, camera="K2", thing="right ski", xy=(10, 20), vertex=0)
    changed = desk.act("Anna", wrong).view
    assert changed is not None
    assert changed.lines["right ski"] != before.lines["right ski"]
    assert changed.space == before.space
    undone = desk.act("Anna", UndoAction(do="undo")).view
    assert undone is not None
    assert undone.model_copy(update={"revision": before.revision}) == before
    anew = opened(jump, survey=False)
    adopt(anew, Oriented.of(desk))
    desk.close()
    assert anew.view("Anna", 20) == undone
    anew.close()


def test_epipolar_curves_meet_the_truth_also_where_lenses_distort(desk: Desk, jump: HillLog) -> None:
    system = desk.programs.oriented()
    system = _distorted(system)
    truth = jump.truth[20]["points"]
    for xyz in truth.values():
        for name, camera in system.cameras.items():
            curves = epipolar_curves(system, name, camera.project(np.array(xyz)), 0.01 * np.eye(2))
            for other, curve in curves.items():
                place = system[other].project(np.array(xyz))
                assert _distance(curve.line, place) < 0.1, (name, other)
                assert _distance(curve.line, place) <= _distance(curve.low, place) + 1e-9


def _distorted(system: CameraSystem) -> CameraSystem:
    """The same cameras with lenses that bend lines by some pixels."""
    cameras = {}
    for name, placed in system.cameras.items():
        interior = placed.camera.interior.copy()
        interior[INTERIOR.index("a1")] = 0.15 / interior[0] ** 2
        cameras[name] = replace(placed, camera=replace(placed.camera, interior=interior))
    return replace(system, cameras=cameras)


def _distance(curve: np.ndarray, place: np.ndarray) -> float:
    start, way = curve[:-1], np.diff(curve, axis=0)
    along = np.clip(((place - start) * way).sum(axis=1) / np.maximum((way**2).sum(axis=1), 1e-12), 0, 1)
    return float(np.linalg.norm(start + along[:, None] * way - place, axis=1).min())


def test_two_rays_predict_the_third_and_two_pulses_the_next(desk: Desk, jump: HillLog) -> None:
    for click in clicks(desk, jump, 5, range(18, 20)):
        desk.act("Anna", click.action())
    now = [click for click in clicks(desk, jump, 6, range(20, 21)) if click.thing == "P1"]
    assert len(now) == 3
    by_time = desk.view("Anna", 20).predicted["K3"]["P1"]
    assert by_time.source == "time"
    third = now[2]
    for click in now[:2]:
        desk.act("Anna", click.action())
    by_rays = desk.view("Anna", 20).predicted["K3"]["P1"]
    assert by_rays.source == "rays"
    for place in (by_time, by_rays):
        assert np.hypot(*np.subtract(place.xy, third.xy)) < 5 * np.hypot(place.ellipse[0], 0.3)
    geometry = desk.geometry("Anna", 20, "K3", "P1", third.xy)
    assert set(geometry.curves) == {"K1", "K2"}
    assert geometry.space is not None
    assert geometry.space.status == "controlled"


def test_the_next_click_is_where_a_third_ray_is_missing(desk: Desk, jump: HillLog) -> None:
    assert desk.suggestion("Anna") is None
    for click in clicks(desk, jump, 5, range(15, 22)):
        if (click.pulse, click.thing) != (18, "P1") or click.camera == "K1":
            desk.act("Anna", click.action())
    told = desk.suggestion("Anna")
    assert told is not None
    rays = desk.view("Anna", told.pulse).space[told.thing].rays
    assert told.camera not in rays
    assert len(rays) < 3
    before = _trace(desk, told.pulse, told.thing)
    truth = np.array(jump.truth[told.pulse]["points"][told.thing])
    x, y = desk.programs.oriented()[told.camera].project(truth)
    desk.act("Anna", PlaceAction(do="place", pulse=told.pulse, camera=told.camera, thing=told.thing, xy=(x, y)))
    assert _trace(desk, told.pulse, told.thing) < before
    assert desk.suggestion("Anna") != told


def _trace(desk: Desk, pulse: int, thing: str) -> float:
    sigma = desk.view("Anna", pulse).space[thing].sigma
    return np.inf if sigma is None else float(np.square(sigma).sum())


def test_a_tape_gives_a_length_with_its_sigma(desk: Desk, jump: HillLog) -> None:
    system, points = desk.programs.oriented(), jump.truth[20]["points"]
    ends = {
        end: {name: tuple(camera.project(np.array(points[thing]))) for name, camera in system.cameras.items()}
        for end, thing in (("from", "P1"), ("to", "P2"))
    }
    length = desk.tape(TapeOrder(pulse=20, **ends))
    assert length.value == pytest.approx(np.linalg.norm(np.subtract(points["P1"], points["P2"])), abs=0.01)
    assert 0.001 < length.sigma < 0.05
    with pytest.raises(BadInputError, match="click each in two images or more"):
        desk.tape(TapeOrder(pulse=20, **{"from": {"K1": ends["from"]["K1"]}, "to": ends["to"]}))


def test_fifty_times_undo_and_redo_leave_the_measurements_as_they_were(
    desk: Desk, jump: HillLog, tmp_path: Path
) -> None:
    for click in clicks(desk, jump, 7, range(12, 18)):
        desk.act("Anna", click.action())
    desk.act("Anna", StateAction(do="state", pulse=12, camera="K1", thing="P2", state="hidden"))
    write_measurements(desk.programs.measurements("Anna"), tmp_path / "before.json")
    for do in ("undo", "redo"):
        for _ in range(50):
            assert desk.act("Anna", UndoAction(do=do)).touched is not None
    write_measurements(desk.programs.measurements("Anna"), tmp_path / "after.json")
    assert (tmp_path / "after.json").read_bytes() == (tmp_path / "before.json").read_bytes()
    assert (tmp_path / "before.json").stat().st_size > 1000


def test_without_a_survey_images_are_measured_and_nothing_in_space(jump: HillLog) -> None:
    desk = opened(jump, survey=False)
    opening = desk.opening()
    assert opening.orientation.state == "none"
    assert "--survey" in str(opening.orientation.message)
    changed = desk.act("Anna", PlaceAction(do="place", pulse=20, camera="K1", thing="P1", xy=(10, 20)))
    assert changed.view is not None
    assert changed.view.marks["K1"]["P1"].xy == (10, 20)  # type: ignore[union-attr]
    assert changed.view.space == {}
    with pytest.raises(StateForbidsError, match="not oriented"):
        desk.geometry("Anna", 20, "K1", "P1", (10, 20))
    with pytest.raises(StateForbidsError, match="nothing can be computed in space"):
        desk.programs.compute("Anna")
    desk.close()


def test_a_survey_of_other_cameras_says_which_it_has_and_proposes_no_clicks(jump: HillLog, tmp_path: Path) -> None:
    names = re.sub(r'"K(\d)"', r'"camera \1"', jump.survey.read_text())
    survey = tmp_path / "other.json"
    survey.write_text(names)
    desk = opened(replace(jump, survey=survey))
    state = desk.opening().orientation
    assert state.state == "failed"
    assert "has none of the log's cameras K1, K2, K3 (there: camera 1, camera 2, camera 3)" in str(state.message)
    assert "click" not in str(state.message)
    desk.close()


def test_a_log_that_is_being_written_is_measured_as_far_as_it_goes(jump: HillLog, tmp_path: Path) -> None:
    whole = jump.path.read_bytes()
    growing = tmp_path / "growing.mcap"
    growing.write_bytes(whole[: len(whole) // 2])
    desk = opened(replace(jump, path=growing), survey=False)
    assert 10 < len(desk.log.pulses) < len(jump.truth)
    last = desk.log.pulses[-1]
    action = PlaceAction(do="place", pulse=last, camera="K2", thing="P1", xy=(10, 20))
    assert desk.act("Anna", action).touched is not None
    assert desk.log.png(last, "K2").startswith(b"\x89PNG")
    desk.close()


@pytest.mark.timeout(2 * PATIENCE_S)
def test_nothing_takes_the_computer_from_a_recording(jump: HillLog) -> None:
    recording = True
    files = DeskFiles(jump.path, jump.path.with_suffix(".digitized"), jump.path.with_suffix(".measured"))
    source = read_source(jump.survey, None)
    desk = Desk(files, lambda: source, lambda: recording)
    said = "a recording runs: the cameras are oriented when it has ended"
    wait_until(lambda: str(desk.opening().orientation.message) == said, "orienting stands still")
    changed = desk.act("Anna", PlaceAction(do="place", pulse=20, camera="K1", thing="P1", xy=(10, 20)))
    assert changed.view is not None
    assert changed.view.space == {}
    assert desk.programs.follow("Anna", TrackOrder(things=["P1"], pulse=20, direction=1, most=2)).state == "tracking"
    wait_until(lambda: desk.programs.follower.state("Anna").paused, "following stands still")
    recording = False
    desk.programs.orienting.wait(PATIENCE_S)
    assert desk.opening().orientation.state == "done"
    told = desk.programs.follower.wait("Anna", PATIENCE_S)
    assert told.tracked == {"P1": []}  # nothing stands out where it was marked
    assert str(told.stopped["P1"]) == "it was tracked as far as was asked"
    desk.close()


def test_clicked_balls_orient_the_cameras(jump: HillLog) -> None:
    desk = opened(jump)
    true = desk.programs.oriented()
    balls = desk.programs.orienting.balls
    assert balls is not None
    desk.programs.orient("Bo")
    wait_until(lambda: desk.programs.orienting.state.state != "working", "nobody clicked a ball")
    assert "an image needs 4 clicked balls or more" in str(desk.programs.orienting.state.message)
    random = np.random.default_rng(8)
    for name, camera in true.cameras.items():
        for ball, xyz in zip(balls.names, balls.xyz, strict=True):
            px = camera.project(xyz)
            if (px > 0).all() and (px < camera.size - 1).all():
                x, y = px + random.normal(0, 0.2, 2)
                action = PlaceAction(
                    do="place", pulse=1, camera=name, thing=f"ball:{ball}", xy=(x, y), sigma=(0.2, 0.2)
                )
                desk.act("Bo", action)
    desk.programs.orient("Bo")
    wait_until(lambda: desk.programs.orienting.state.state != "working", "the cameras are oriented", 60)
    assert desk.programs.orienting.state.state == "done", desk.programs.orienting.state
    found = desk.programs.oriented()
    for name, camera in found.cameras.items():
        sigma = np.sqrt(np.diagonal(found.covariance)[camera.columns[:3]])
        assert (np.abs(camera.position - true[name].position) < 5 * np.maximum(sigma, 0.02)).all()
    proposed = desk.view("Bo", 20).predicted["K1"]
    assert any(thing.startswith("ball:") for thing in proposed)
    desk.close()
