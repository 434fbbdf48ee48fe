"""The path-traced renderer of the corpus, as far as it needs no Blender: what is told to it, and what is made of it."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from bench.corpus.__main__ import main
from bench.corpus.draws import Half, Scene, draw
from bench.corpus.path_traced.figure import Figure
from bench.corpus.path_traced.hill import PathTracedHill
from bench.corpus.path_traced.optics import FINER, Optics
from bench.corpus.path_traced.pictures import kept_in
from bench.corpus.path_traced.stage import Stage
from rig.arrays import Floats
from rig.pulse import HillPulse
from simrig.world.conditions.camera_motion import CameraMotion
from simrig.world.jumper import JumpSeries
from simrig.world.scenario import Scenario
from simrig.world.truth import truth


@pytest.fixture(scope="module")
def scene() -> Scene:
    return draw(Half.WORK, 59)


@pytest.fixture(scope="module")
def stage(scene: Scene) -> Stage:
    return _stage(scene.scenario, scene, scene.pulses[20:22])


def _stage(scenario: Scenario, scene: Scene, pulses: range) -> Stage:
    states = {s["pulse"]: s for s in truth(scenario, map(HillPulse, pulses), scene.rate_hz, scene.size)["pulses"]}
    return Stage(scenario, states, _optics(scenario, scene))


def _optics(scenario: Scenario, scene: Scene) -> list[Optics]:
    return [Optics(scenario, index, scene.size) for index in range(len(scenario.cameras))]


def test_plates_of_the_markers_are_where_the_truth_has_the_markers(scene: Scene, stage: Stage) -> None:
    told = stage.told
    (state, *_) = truth(scene.scenario, [HillPulse(scene.pulses[20])], scene.rate_hz, scene.size)["pulses"]
    for camera, optics in zip(scene.scenario.cameras, _optics(scene.scenario, scene), strict=True):
        (shot,) = [shot for shot in told["shots"] if shot["name"] == f"{camera.name}-{scene.pulses[20]}"]
        left, top, right, bottom = shot["rectangles"][0]
        for label, point in state["points"].items():
            place = np.array(shot["places"][f"{label} marker"])[:3, 3]
            assert place == pytest.approx(np.array(point), abs=1e-9)
            x, y = optics.pixels(place[None])[0]
            width, height = optics.size
            inside = 0 <= x < width and 0 <= y < height
            assert not inside or (left <= x < right and top <= y < bottom)
        assert np.linalg.norm(shot["way"]) == pytest.approx(state["speed"] * camera.exposure_us / 1e6, rel=1e-6)


def test_the_body_keeps_clear_of_the_plates(scene: Scene) -> None:
    """Seen along the axis of the plates of helmet and hip, nothing of the body in flight is nearer than they are."""
    towards = np.array((0.6, -1.0, 0.1))
    towards /= np.linalg.norm(towards)
    figure = Figure(scene.scenario.jumper, towards, bend_m=0.01, patched=True)
    jump = JumpSeries(scene.scenario).first()
    for since_s in (0.1, 0.4, 0.8):
        pose = jump.pose(since_s)
        placed = figure.placed(pose, (True,) * 4)
        for name, (mesh, matrix) in placed.items():
            if name.startswith("P"):
                continue
            corners = figure.meshes[mesh][0].corners @ matrix[:3, :3].T + matrix[:3, 3]
            for label in ("P1", "P2"):
                plate = placed[f"{label} marker"][1]
                off, axis = corners - plate[:3, 3], plate[:3, 2]
                beside = np.linalg.norm(off - np.outer(off @ axis, axis), axis=1)
                over = (off @ axis)[beside < scene.scenario.jumper.marker_radius_m]
                assert not len(over) or over.max() < 0, (name, since_s)


def test_the_snow_hides_no_ball_from_a_camera(scene: Scene, stage: Stage) -> None:
    share = np.linspace(0.02, 1, 200)[:, None]
    for camera in scene.scenario.cameras:
        for ball in scene.scenario.balls:
            line = np.array(ball.X) + share * (np.array(camera.X0) - ball.X)
            assert (line[:, 2] > stage.scenery.snow(line[:, 0], line[:, 1])).all()


def test_the_images_have_the_lens_and_the_shake_of_the_scenario(
    scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Spots that the pictures show at the balls are in the images where the cameras see the balls."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    quiet = scene.scenario.image.model_copy(update={"noise_sigma": 0.0, "electrons_per_grey": 0.0})
    shaken = [camera.model_copy(update={"shake_deg": 0.05}) for camera in scene.scenario.cameras]
    scenario = scene.scenario.model_copy(update={"image": quiet, "cameras": tuple(shaken)})
    pulses = scene.pulses[20:21]
    stage, optics = _stage(scenario, scene, pulses), _optics(scenario, scene)
    folder, balls = kept_in(stage.told), np.array([ball.X for ball in scenario.balls])
    folder.mkdir(parents=True)
    pictures = {camera.name: _spots(of, balls) for camera, of in zip(scenario.cameras, optics, strict=True)}
    for shot in stage.told["shots"]:
        for k, (left, top, right, bottom) in enumerate(shot["rectangles"]):
            part = pictures[shot["camera"]][top:bottom, left:right]
            cv2.imwrite(str(folder / f"{shot['name']}.{k}.png"), part)
        (folder / f"{shot['name']}.json").write_text("{}")
    hill = PathTracedHill(scenario, pulses, scene.size, scene.rate_hz)
    checked = 0
    for index, camera in enumerate(scenario.cameras):
        image = hill.frame(index, HillPulse(pulses[0])).astype(float) - quiet.black_level
        moved = CameraMotion(scenario, index).at(
            camera.projection(*scene.size), camera.middle_s(HillPulse(pulses[0]), scene.rate_hz)
        )
        spots = moved.pixels([ball.X for ball in scenario.balls])
        for spot in spots:
            others = np.linalg.norm(spots - spot, axis=1)
            if moved.sees(spot, margin=9) and np.sort(others)[1] > 16:
                assert _middle(image, spot) == pytest.approx(spot, abs=0.03)
                checked += 1
    assert checked > 10


def _spots(optics: Optics, places: Floats) -> np.ndarray[tuple[int, ...], np.dtype[np.uint16]]:
    x, y = np.meshgrid(*map(np.arange, optics.size))
    image = np.zeros(x.shape)
    for u, v in optics.pixels(places):
        image += np.exp(-((x - u) ** 2 + (y - v) ** 2) / (2 * (1.5 * FINER) ** 2))
    return np.asarray(np.round(20000 * np.minimum(image, 1)), np.uint16)


def _middle(image: Floats, spot: Floats) -> Floats:
    """Centroid of the image about a spot, px."""
    column, row = np.round(spot).astype(int)
    part = np.maximum(image[row - 7 : row + 8, column - 7 : column + 8], 0)
    y, x = np.mgrid[row - 7 : row + 8, column - 7 : column + 8]
    return np.asarray(((part * x).sum(), (part * y).sum())) / float(part.sum())


def test_without_blender_there_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setenv("PATH", str(tmp_path))
    asked = ["--scenes", "1", "--pixels", "40000000", "--workers", "1", "--renderer", "path-traced", "--fresh"]
    with pytest.raises(SystemExit) as stopped:
        main([*asked, "--results", str(tmp_path)])
    assert str(stopped.value) == "path-traced pictures need Blender, which is missing: apt install blender"
