"""A board before the cameras: drawn where the projection says, still and moving, and as `svev target` prints it."""

import json
from pathlib import Path

import numpy as np
import pytest

from analysis.targets.detection import Sight, find_targets
from analysis.targets.pattern import Layout
from analysis.targets.sheets import board_geometry, frame_geometry
from rig.arrays import Floats
from rig.errors import BadInputError
from rig.pulse import HillPulse
from rig.settings.file import CONFIG
from simrig.images.view import CameraView
from simrig.world.board import MM_PER_M, Placed, load_sheets, placed
from simrig.world.scenario import Scenario, load_scenario

RATE_HZ = 10.0
_FILE = CONFIG / "scenarios" / "calibration.toml"


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return load_scenario(_FILE)


def _sight(view: CameraView, time_s: float) -> Sight:
    out = np.zeros((480, 640), np.uint8)
    view.render_into(out, HillPulse(round(time_s * RATE_HZ)))
    return find_targets(out, Layout(), "drawn")


def test_corners_are_where_the_projection_shows_them(scenario: Scenario) -> None:
    """Errors have the size of their sigmas, to 3 sigma of what so many errors can tell of it.

    Rays that are not averaged over what they cover make errors a seventh larger than that.
    """
    assert scenario.board is not None
    view = CameraView(scenario, 2, 640, 480, RATE_HZ)
    before, camera = (scenario.cameras[i].projection(640, 480) for i in (1, 2))
    off = []
    for number in range(0, len(scenario.board.poses), 2):
        board = placed(scenario.board.poses[number], before)
        for name, corner in _sight(view, 4.0 * number + 1.0).corners.items():
            place = Layout().board_place(name)
            assert place is not None
            right, up = (place[:2] + np.array([-135.0, 90.0])) / 1000.0  # from the middle of 9 x 6 squares of 30 mm
            x, y = camera.pixels(board.middle + right * board.axes[:, 0] + up * board.axes[:, 1])
            off += [(corner.x - x) / corner.sigma_x, (corner.y - y) / corner.sigma_y]
    assert len(off) > 350
    assert np.sqrt(np.mean(np.square(off))) < 1.0 + 3.0 / np.sqrt(2.0 * len(off))


def test_targets_of_a_frame_are_where_the_projection_shows_them_one_before_the_other(
    scenario: Scenario, tmp_path: Path
) -> None:
    """The frame of `svev target`, whose targets are at four depths; a blank sheet hides one of them."""
    assert scenario.board is not None
    geometry = frame_geometry(Layout())
    first = geometry["sheets"][0]
    across, up, depth = first["middle_mm"]
    cover = first | {"black": [], "middle_mm": [across, up, depth + 10.0]}
    (tmp_path / "targets.json").write_text(json.dumps(geometry | {"sheets": [cover, *geometry["sheets"]]}))
    held = scenario.board.model_copy(update={"pattern": tmp_path / "targets.json"})
    poses = tuple(pose.model_copy(update={"away_m": 1.4, "right_m": 0.0, "up_m": 0.0}) for pose in scenario.board.poses)
    held = held.model_copy(update={"poses": poses})
    view = CameraView(scenario.model_copy(update={"board": held}), 1, 640, 480, RATE_HZ)
    camera = scenario.cameras[1].projection(640, 480)
    sheets = load_sheets(tmp_path / "targets.json")[1:]
    off, named = [], set()
    for number in range(0, len(poses), 2):
        frame = placed(poses[number], camera)
        for name, corner in _sight(view, 4.0 * number + 1.0).corners.items():
            x, y = camera.pixels(_corner(frame.sheet(sheets[int(name[1:-1]) - 100]), name[-1]))
            off.append((corner.x - x, corner.y - y))
            named.add(name)
    assert {f"T{code}{letter}" for code in range(101, 116) for letter in "abcd"} <= named
    assert not {f"T100{letter}" for letter in "abcd"} & named
    assert np.sqrt(np.mean(np.square(off))) < 0.02


def _corner(target: Placed, letter: str) -> Floats:
    """(3,) m of a corner of a target's white square."""
    right, up = {"a": (-1, 1), "b": (1, 1), "c": (1, -1), "d": (-1, -1)}[letter]
    half = Layout().single_mm / 2.0 / MM_PER_M
    return np.asarray(target.middle + half * (right * target.axes[:, 0] + up * target.axes[:, 1]), float)


def test_it_is_still_and_then_moves_to_the_next_pose(scenario: Scenario) -> None:
    assert scenario.board is not None
    (first, still), (same, _), (other, moving) = (scenario.board.at(t) for t in (0.5, 2.5, 3.5))
    assert (first, still, same, moving) == (scenario.board.poses[0], True, scenario.board.poses[0], False)
    assert first.turn_deg < other.turn_deg < scenario.board.poses[1].turn_deg
    assert scenario.board.at(4.0 * len(scenario.board.poses) + 0.5) == (first, True)


def test_the_shipped_pattern_is_the_one_that_svev_target_prints() -> None:
    shipped = json.loads((CONFIG / "scenarios" / "board.json").read_text())
    assert shipped == json.loads(json.dumps(board_geometry(Layout())))


def test_another_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "board.json").write_text('{"sheets": [{"width_mm": 1}]}')
    with pytest.raises(BadInputError, match=r"is no board\.json or targets\.json of svev target"):
        load_sheets(tmp_path / "board.json")
    with pytest.raises(BadInputError, match="cannot be read"):
        load_sheets(tmp_path / "none.json")
    text = _FILE.read_text().replace('before = "K2"', 'before = "K9"')
    (tmp_path / "scenario.toml").write_text(text)
    with pytest.raises(BadInputError, match="no such camera; name one of K1, K2, K3"):
        load_scenario(tmp_path / "scenario.toml")
