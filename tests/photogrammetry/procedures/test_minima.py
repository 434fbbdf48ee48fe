"""A plane of surveyed points has two poses: the least minimum is taken, and none where the residuals do not decide."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from photogrammetry.adjustment.equations.unknowns import State, state_of
from photogrammetry.adjustment.solution.adjustment import Adjustment, adjust_once
from photogrammetry.geometry.ideal_camera import IdealCamera
from photogrammetry.network.diagnosis import NotSolvableError
from photogrammetry.network.file_writer import write_network
from photogrammetry.network.model import Image, Network
from photogrammetry.procedures.minima import adjust_least, minima
from photogrammetry.procedures.orientation import orient
from photogrammetry.procedures.stages import snoop_network
from photogrammetry.start_values.resection import second_pose
from photogrammetry.start_values.search import complete
from rig.images.viewing import look_at
from svev.cli import main
from tests.photogrammetry.planar import C, Planar, observed, planar
from tests.photogrammetry.synthetic import hill
from tests.support.repeats import repeats


def _truth(case: Planar) -> State:
    interior = np.array([camera.interior for camera in case.network.cameras])
    position, rotation = (np.array([getattr(camera, name) for camera in case.cameras]) for name in ("X0", "R"))
    return State(interior, position, rotation, case.xyz)


def _off(case: Planar, a: Adjustment) -> float:
    """Largest error of a projection centre in sigmas."""
    sigma = a.sigmas(a.problem.unknowns.pose[:, :3])
    return float(np.abs((a.state.position - [camera.X0 for camera in case.cameras]) / sigma).max())


def _in_other_pose(case: Planar, chosen: tuple[int, ...]) -> State:
    """The truth with the poses of some images reflected."""
    state = _truth(case)
    position, rotation = state.position.copy(), state.rotation.copy()
    known = [i for i, point in enumerate(case.network.points) if point.xyz is not None]
    for i in chosen:
        other = second_pose(case.cameras[i], case.xyz[known], case.cameras[i].project(case.xyz[known]))
        assert other is not None
        position[i], rotation[i] = other.camera.X0, other.camera.R
    return replace(state, position=position, rotation=rotation)


def test_the_second_pose_is_the_second_minimum_of_a_plane_and_of_nothing_else() -> None:
    case = planar(np.random.default_rng(1), 1, 60.0)
    camera, xy = case.cameras[0], case.cameras[0].project(case.xyz)
    other = second_pose(camera, case.xyz, xy)
    assert other is not None
    assert np.linalg.norm(other.camera.X0 - camera.X0) > 10.0
    assert np.sqrt(other.square_sum / len(xy)) < 0.3
    again = second_pose(other.camera, case.xyz, xy)
    assert again is not None
    assert np.abs(again.camera.X0 - camera.X0).max() < 1e-3
    network = hill(1, noise=0.0).network
    xyz = np.array([point.xyz for point in network.points])
    image = network.images[0]
    assert image.position is not None
    assert image.rotation is not None
    there = replace(camera, X0=image.position, R=image.rotation)
    assert second_pose(there, xyz, there.project(xyz)) is None


@pytest.mark.parametrize("command", ["adjust", "orient"])
def test_a_plane_from_afar_has_two_poses_and_none_is_believed(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    case = planar(np.random.default_rng(1), 1, 60.0)
    write_network(case.network, tmp_path / "field.json")
    assert main([command, str(tmp_path / "field.json"), "--force", "-o", str(tmp_path / "poses.json")]) == 3
    result = json.loads((tmp_path / "poses.json").read_text())
    assert result["diagnosis"][0]["images"] == ["C0"]
    assert "images" not in result
    words = capsys.readouterr().out
    assert "image C0 has 2 poses between which the residuals do not decide" in words
    places = [json.loads(f"[{place.split(')')[0]}]") for place in words.split("X0 ")[1].split("(")[1:3]]
    nearest = min(np.linalg.norm(np.array(place) - case.cameras[0].X0) for place in places)
    assert nearest < 10.0
    assert np.linalg.norm(np.subtract(*places)) > 10.0


@pytest.mark.parametrize("chosen", repeats([((0,),), ((0, 1, 2),), ((0, 1),), ((2,),)], quick=2))
def test_from_near_the_least_minimum_is_found_from_any_other(chosen: tuple[int, ...]) -> None:
    case = planar(np.random.default_rng(3), max(chosen) + 1, 20.0)
    start = _in_other_pose(case, chosen)
    wrong = adjust_once(case.network, start)
    assert _off(case, wrong) > 5.0
    found = adjust_least(case.network, start, case.network).adjustment
    right = adjust_once(case.network, _truth(case))
    assert found.equations.square_sum == pytest.approx(right.equations.square_sum, abs=1e-6)
    assert _off(case, found) < 5.0
    for a in (orient(case.network).outcome.adjustment, snoop_network(case.network).adjustment):
        assert a.equations.square_sum == pytest.approx(right.equations.square_sum, abs=1e-6)


def test_of_many_images_each_one_is_reflected() -> None:
    case = planar(np.random.default_rng(4), 5, 20.0)
    found = adjust_least(case.network, _in_other_pose(case, (1, 3)), case.network).adjustment
    assert _off(case, found) < 5.0


def test_a_tie_point_off_the_plane_decides() -> None:
    case = planar(np.random.default_rng(8), 2, 60.0, ties=5)
    with_ties = orient(case.network).outcome.adjustment
    assert _off(case, with_ties) < 5.0
    assert len(minima(with_ties)) > 1


@pytest.mark.parametrize("which", [0, 1])
def test_an_approximate_pose_decides_where_the_residuals_do_not(which: int) -> None:
    case = planar(np.random.default_rng(1), 1, 60.0)
    start = _truth(case) if which == 0 else _in_other_pose(case, (0,))
    near = start.position[0] + (3.0, -2.0, 2.0)
    network = replace(case.network, images=(Image("C0", 0, near, start.rotation[0]),))
    for a in (
        orient(network).outcome.adjustment,
        adjust_least(network, state_of(complete(network)), network).adjustment,
    ):
        assert np.linalg.norm(a.state.position[0] - start.position[0]) < 10.0


@pytest.mark.parametrize("seed", [0, 18])
def test_a_block_that_only_the_images_allow_does_not_speak_against_the_survey(seed: int) -> None:
    """Two images of a plane form two blocks that fit them exactly; in one of them the plane is deformed."""
    case = planar(np.random.default_rng(seed), 2, 30.0)
    orientation = orient(case.network)
    assert orientation.stages[1].words.startswith("left out: the images alone form a block other than")
    assert orientation.outcome.removed == ()
    assert _off(case, orientation.outcome.adjustment) < 5.0


@pytest.mark.parametrize("blunder_px", [0.0, 15.0])
def test_observations_that_only_another_block_contradicts_are_used(blunder_px: float) -> None:
    """The free block is none of the survey's, and in it five sound image points are gross errors."""
    rng = np.random.default_rng([5511, 48])
    distance, ties = rng.uniform(10.0, 45.0), int(rng.integers(0, 6))
    case = planar(rng, 3, distance, ties=ties)
    case.network.observations.xy[4, 0] += blunder_px  # G4 in C0
    orientation = orient(case.network)
    gone = [
        case.network.points[one.network.observations.point[one.blunder.suspect.index]].name
        for one in orientation.outcome.removed
    ]
    assert gone == (["G4"] if blunder_px else [])
    assert _off(case, orientation.outcome.adjustment) < 5.0


def _is_wrong(case: Planar) -> bool:
    """Whether a field gets poses that are wrong, or another failure than that nothing decides."""
    try:
        a = orient(case.network).outcome.adjustment
    except NotSolvableError as error:
        return not any(
            words in str(error) for words in ("between which the residuals do not decide", "hardly determined")
        )
    return _off(case, a) > 5.0


def _drawn(images: int, seed: int) -> Planar:
    rng = np.random.default_rng([711, images, seed])
    return planar(rng, images, rng.uniform(20.0, 100.0))


@pytest.mark.parametrize("images", [1, 2, 3])
def test_no_plane_is_wrong_and_believed(images: int) -> None:
    assert not [seed for seed in range(6 // images) if _is_wrong(_drawn(images, seed))]


@pytest.mark.parametrize(("seed", "images"), [(3, 2), (7, 2), (11, 1)])
def test_a_place_beyond_its_sigmas_is_not_given(seed: int, images: int) -> None:
    """Four or five balls, some nearly on a line, 60 to 85 m away: errors of 4 to 12 sigmas were given."""
    rng = np.random.default_rng([901, images, seed])
    distance, size, count = rng.uniform(20.0, 100.0), rng.uniform(2.0, 8.0), int(rng.integers(4, 7))
    field = np.column_stack([rng.uniform(0.0, size, (count, 2)), np.zeros(count)])
    case = planar(rng, images, distance, field)
    with pytest.raises(NotSolvableError, match="is hardly determined: the residuals allow places farther from X0"):
        orient(case.network)


def test_a_small_sigma0_of_few_observations_shrinks_no_sigma() -> None:
    """Four points in space leave two redundant observations: with their sigma0, one of 26 was off by five sigmas."""
    rng = np.random.default_rng(12)
    place = np.array((3.0, -19.0, 5.0))
    camera = IdealCamera(C, place, look_at(place, np.zeros(3), 0.0))
    beyond = small = 0
    for _ in range(120):
        case = observed((camera,), rng.uniform(-4.0, 4.0, (4, 3)), 4, rng)
        a = replace(adjust_once(case.network, _truth(case)), cautious=True)
        small += a.ratio < 0.3
        beyond += _off(case, a) > 5.0
    assert small > 5
    assert beyond == 0


@pytest.mark.long
@pytest.mark.parametrize("first", range(0, 60, 20))
@pytest.mark.parametrize("images", [1, 2, 3])
def test_no_plane_of_many_is_wrong_and_believed(images: int, first: int) -> None:
    assert not [seed for seed in range(first, first + 20) if _is_wrong(_drawn(images, seed))]


def test_networks_that_are_no_planes_have_one_minimum() -> None:
    network: Network = hill(2, helmets=17).network
    assert len(minima(orient(network).outcome.adjustment)) == 1
