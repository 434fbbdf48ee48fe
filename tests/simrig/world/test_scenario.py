from pathlib import Path

import numpy as np
import pytest

from rig.errors import BadInputError
from rig.images.viewing import look_at
from rig.settings.file import CONFIG
from simrig.world.faults import FaultKind
from simrig.world.scenario import Scenario, SceneCamera, load_scenario

SMALL = """
name = "small"
seed = 1
[[cameras]]
name = "K1"
c = 1420.0
X0 = [-20.0, -32.0, 5.0]
look_at = [9.0, 0.0, -3.0]
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "scene.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_the_shipped_training_session_is_the_papers_set_up(training: Scenario) -> None:
    assert [round(camera.c) for camera in training.cameras] == [1420, 1422, 2493]
    away = [float(camera.projection(640, 480).distance(camera.look_at or ())) for camera in training.cameras]
    assert away == pytest.approx([44, 44, 78], abs=0.6)
    assert len({np.sign(camera.X0[1]) for camera in training.cameras}) == 1
    assert sorted(ball.role for ball in training.balls) == ["control"] * 15 + ["tie"] * 6
    assert not training.faults


def test_every_ball_is_in_sight_of_every_camera(training: Scenario) -> None:
    places = [ball.X for ball in training.balls]
    for camera in training.cameras:
        projection = camera.projection(640, 480)
        assert projection.sees(projection.pixels(places), margin=12).all()


def test_the_shipped_faults_are_one_of_each(training: Scenario) -> None:
    scenario = load_scenario(CONFIG / "scenarios" / "faults.toml")
    kinds = [FaultKind.MISSED_PULSE, FaultKind.LOST_FRAME, FaultKind.LOST_PACKETS, FaultKind.DAMAGED_FRAME]
    assert [fault.kind for fault in scenario.faults] == kinds
    assert [fault.at_pulse for fault in scenario.faults_of("K1")] == [155, 175]
    assert scenario.model_copy(update={"name": training.name, "faults": ()}) == training


def test_a_scenario_needs_only_name_seed_and_cameras(tmp_path: Path) -> None:
    scenario = load_scenario(written(tmp_path, SMALL))
    assert scenario.camera_index("K1") == 0
    with pytest.raises(BadInputError, match='no camera "K9"; name one of K1'):
        scenario.camera_index("K9")


@pytest.mark.parametrize(
    ("edit", "words"),
    [
        (("seed = 1", "sede = 1"), ["seed"]),
        (("seed = 1", "seed = 1\nsnow = 3"), ['unknown key "snow"', "known keys here"]),
        (("c = 1420.0", "c = 1420.0\ndrift = 3.0"), ['unknown key "cameras.1.drift"', 'did you mean "drift_ppm"']),
        (("c = 1420.0", ""), ['"cameras.1.c" is missing', "add it"]),
        (("c = 1420.0", 'c = "long"'), ['"cameras.1.c"', "correct it"]),
        (("look_at = [9.0, 0.0, -3.0]", ""), ["K1", "either look_at or R", "give one"]),
        (("look_at = [9.0, 0.0, -3.0]", "look_at = [-20.0, -32.0, 0.0]"), ["K1", "straight up or down", "give R"]),
        (("look_at = [9.0, 0.0, -3.0]", "R = [[1.0,0.0,0.0],[0.0,1.0,0.0],[0.0,0.0,2.0]]"), ["no rotation", "give"]),
        (("look_at = [9.0, 0.0, -3.0]", "look_at = [9.0, 0.0, -3.0]\ngain = 1.2"), ["K1", "saturates", "lower gain"]),
        (("seed = 1", "seed = 1\npauses = [[9, 9]]"), ["pauses", "[9, 9]", "later end"]),
        (("seed = 1", "seed = 1\njumper.drag_area_m2 = [[1.0, 0.3], [0.5, 0.3]]"), ["drag_area_m2", "in order"]),
        (("seed = 1", 'seed = 1\nfaults = [{ kind = "lost_frame", camera = "K7" }]'), ["K7", "name one of K1"]),
        (("seed = 1", 'seed = 1\nfaults = [{ kind = "frozen", camera = "K1" }]'), ["frozen", "needs duration_s"]),
        (("seed = 1", "seed = "), ["not valid TOML", "line"]),
    ],
)
def test_a_wrong_scenario_is_refused_in_one_line(tmp_path: Path, edit: tuple[str, str], words: list[str]) -> None:
    path = written(tmp_path, SMALL.replace(*edit))
    with pytest.raises(BadInputError) as raised:
        load_scenario(path)
    message = str(raised.value)
    assert "\n" not in message
    assert str(path) in message
    for word in words:
        assert word in message


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(BadInputError, match=r"nowhere\.toml: no such file; name an existing scenario"):
        load_scenario(tmp_path / "nowhere.toml")


def test_a_name_used_twice_is_refused(tmp_path: Path) -> None:
    twice = SMALL + SMALL[SMALL.index("[[cameras]]") :]
    with pytest.raises(BadInputError, match="camera name K1 is used twice"):
        load_scenario(written(tmp_path, twice))


def test_a_scenario_says_only_what_differs_from_its_base(tmp_path: Path) -> None:
    written(tmp_path, SMALL + "[image]\nnoise_sigma = 1.0\nsnow_flakes = 3\n")
    (tmp_path / "above.toml").write_text('base = "scene.toml"\nseed = 7\nimage = { snow_flakes = 9 }\n')
    scenario = load_scenario(tmp_path / "above.toml")
    assert (scenario.name, scenario.seed) == ("small", 7)
    assert (scenario.image.noise_sigma, scenario.image.snow_flakes) == (1.0, 9)
    (tmp_path / "top.toml").write_text('base = "above.toml"\nimage = { noise_sigma = 2.0 }\n')
    scenario = load_scenario(tmp_path / "top.toml")
    assert (scenario.name, scenario.seed) == ("small", 7)
    assert (scenario.image.noise_sigma, scenario.image.snow_flakes) == (2.0, 9)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('base = "none.toml"', "no such file"),
        ("base = 3", "name of a scenario file"),
        ('base = "scene.toml"\nsede = 3', "sede"),
        ('base = "above.toml"', "above.toml -> above.toml.: remove"),
        ('base = "second.toml"\nname = 3', "name"),
        ('base = "third.toml"', "above.toml -> third.toml -> above.toml.: remove"),
    ],
)
def test_a_wrong_base_is_refused(tmp_path: Path, text: str, words: str) -> None:
    written(tmp_path, SMALL)
    (tmp_path / "second.toml").write_text('base = "scene.toml"')
    (tmp_path / "third.toml").write_text('base = "above.toml"')
    (tmp_path / "above.toml").write_text(text)
    with pytest.raises(BadInputError, match=words):
        load_scenario(tmp_path / "above.toml")


def test_an_orientation_may_be_given_as_rotation() -> None:
    place, target = (-20.0, -32.0, 5.0), (9.0, 0.0, -3.0)
    rows = look_at(place, target).tolist()
    by_rotation = SceneCamera.model_validate({"name": "K1", "c": 1420, "X0": place, "R": rows})
    by_target = SceneCamera.model_validate({"name": "K1", "c": 1420, "X0": place, "look_at": target})
    assert by_rotation.rotation() == pytest.approx(by_target.rotation())


def test_a_larger_image_is_the_same_view(training: Scenario) -> None:
    camera = training.cameras[0]
    small, large = camera.projection(640, 480), camera.projection(1936, 1216)
    centred = [p.pixels((12.0, 1.0, -2.0)) - ((p.width - 1) / 2, (p.height - 1) / 2) for p in (small, large)]
    assert centred[1] == pytest.approx(centred[0] * 1936 / 640)
