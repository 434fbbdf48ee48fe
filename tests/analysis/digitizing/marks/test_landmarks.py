"""Landmarks of a person's own: measured as all points, in templates from a file."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from analysis.digitizing.desk import Desk
from analysis.digitizing.marks.landmarks import read_landmarks
from bench.analysis.hill_logs import HillLog
from rig.api.digitizing import PlaceAction
from rig.errors import BadInputError

EXAMPLE = Path("config/landmarks/boots.toml")


def test_the_example_is_measured_in_space(desk: Desk, jump: HillLog) -> None:
    desk.files = replace(desk.files, landmarks=EXAMPLE)
    own = [thing for thing in desk.opening().things if thing.group == "Boots and skis"]
    assert [thing.title for thing in own] == ["right toe", "left toe", "right ski tip", "left ski tip"]
    assert (own[0].name, own[0].colour, own[3].colour) == ("mark:right toe", "#ffb84d", None)
    xyz = np.array(jump.truth[20]["points"]["P3"])
    for name, camera in desk.programs.oriented().cameras.items():
        x, y = camera.project(xyz)
        desk.act("Anna", PlaceAction(do="place", pulse=20, camera=name, thing=own[0].name, xy=(x, y)))
    point = desk.view("Anna", 20).space["mark:right toe"]
    assert point.X is not None
    assert np.allclose(point.X, xyz, atol=0.01)


def test_the_file_beside_the_recordings_is_taken(desk: Desk) -> None:
    assert {thing.group for thing in desk.opening().things} == {"jumper", "body", "balls"}
    (desk.files.log.parent / "landmarks.toml").write_text(EXAMPLE.read_text())
    assert {"Boots and skis", "Suit"} < {thing.group for thing in desk.opening().things}


def test_the_documentation_shows_the_example() -> None:
    shown = re.search(r"boots.toml -->\n```toml\n(.*?)```", Path("docs/how-to/digitizing.md").read_text(), re.DOTALL)
    assert shown is not None
    assert shown[1] in EXAMPLE.read_text()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "template"),
        ('[[template]]\nname = "A"\nlandmark = []', "landmark"),
        ('[[template]]\nname = "A"\nlandmark = [{name = "x"}, {name = "x"}]', 'a landmark "x" already'),
        ('[[template]]\nname = "A"\nlandmark = [{name = "right hip"}]', 'a landmark "right hip" already'),
        ('[[template]]\nname = "balls"\nlandmark = [{name = "x"}]', 'a template "balls" already'),
        ('[[template]]\nname = "A"\nlandmark = [{name = "x", color = "#ffffff"}]', "color"),
        ('[[template]]\nname = "A"\nlandmark = [{name = "x", colour = "red"}]', "colour"),
        ("[[template", "not valid TOML"),
    ],
)
def test_a_wrong_file_is_refused_with_its_key(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "landmarks.toml"
    path.write_text(text)
    with pytest.raises(BadInputError, match=r"landmarks\.toml") as refused:
        read_landmarks(path)
    assert said in str(refused.value)
