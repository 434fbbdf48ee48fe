"""Pose estimation: each stage finds its kind of gross errors; in sound networks nothing is accused."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import ArrayLike

from photogrammetry.geometry.rotation import nearest_rotation
from photogrammetry.network.model import Network, Reweight, Role
from photogrammetry.network.selection import only_points, rays
from photogrammetry.procedures.findings import StageName
from photogrammetry.procedures.orientation import Orientation, orient
from rig.errors import BadInputError
from tests.photogrammetry.synthetic import Synthetic, hill


def _without_start(network: Network) -> Network:
    """Neither poses nor tie points are known."""
    return replace(
        network,
        images=tuple(replace(image, position=None, rotation=None) for image in network.images),
        points=tuple(replace(p, xyz=None) if p.role is Role.TIE else p for p in network.points),
    )


def _shifted(network: Network, point: int, error: ArrayLike) -> Network:
    points = list(network.points)
    points[point] = replace(
        points[point], xyz=np.asarray(points[point].xyz, dtype=float) + np.asarray(error, dtype=float)
    )
    return replace(network, points=tuple(points))


def _spoilt(network: Network, image: int, point: int, error: ArrayLike) -> Network:
    o = network.observations
    xy = o.xy.copy()
    xy[(o.image == image) & (o.point == point)] += error
    return replace(network, observations=replace(o, xy=xy))


def _messages(orientation: Orientation) -> list[list[str]]:
    return [[finding.message for finding in stage.findings if finding.removed] for stage in orientation.stages]


def _errors_in_sigmas(case: Synthetic, orientation: Orientation) -> np.ndarray:
    """Errors of the projection centres over their sigmas."""
    a = orientation.outcome.adjustment
    error = a.state.position - case.truth.position
    return np.asarray(error / a.sigmas(a.problem.unknowns.pose[:, :3]))


@pytest.mark.parametrize("alternative", [1, 2])
@pytest.mark.parametrize("seed", range(1, 5))
def test_sound_networks_accuse_nobody(seed: int, alternative: int) -> None:
    case = hill(seed, helmets=17)
    orientation = orient(_without_start(case.network), alternative)
    assert [stage.name for stage in orientation.stages] == list(StageName)
    assert [stage.findings for stage in orientation.stages] == [(), (), ()]
    assert np.abs(_errors_in_sigmas(case, orientation)).max() < 4.0  # 9 normal numbers: a chance of 0.06 %


def test_given_poses_lead_to_the_same() -> None:
    network = hill(1, helmets=17).network
    given, found = (orient(n).outcome.adjustment for n in (network, _without_start(network)))
    sigma = found.sigmas(found.problem.unknowns.pose[:, :3])
    assert np.abs((given.state.position - found.state.position) / sigma).max() < 1e-5


def test_moving_points_make_the_poses_more_accurate() -> None:
    """Alternative 2 has all observations of alternative 1 and more, so its a-priori sigmas cannot be larger."""
    network = hill(1, helmets=17).network
    static, moving = (orient(network, alternative).outcome.adjustment for alternative in (1, 2))
    sigmas = [a.sigmas(a.problem.unknowns.pose) / a.ratio for a in (static, moving)]
    assert np.all(sigmas[1] < sigmas[0])
    assert len(static.network.points) == 21
    assert len(moving.network.points) == 38


@pytest.mark.parametrize("error", [(3.0, 8.0), (-5.0, 60.0), (-60.0, 200.0)])
def test_image_point_is_found_in_the_free_adjustment(error: tuple[float, float]) -> None:
    network = _spoilt(_without_start(hill(2, helmets=17).network), 1, 7, error)
    free, fit, constrained = _messages(orient(network))
    assert len(free) == 1
    assert "point B8 in image hill-2" in free[0]
    assert (fit, constrained) == ([], [])


def test_an_image_point_that_the_images_alone_cannot_tell_from_another_is_found_with_the_survey() -> None:
    """Nearly along the epipolar line of another image, 190 px: a wrong point there would explain it as well.

    The block of the second stage leaves both out, so that no reference point is accused instead.
    """
    network = _spoilt(_without_start(hill(2, helmets=17).network), 1, 7, (120.0, -150.0))
    orientation = orient(network)
    message = orientation.stages[0].findings[0].message
    assert message.startswith("one of these observations is wrong")
    assert "point B8 in image hill-2" in message
    free, fit, constrained = _messages(orientation)
    assert (free, fit) == ([], [])
    assert len(constrained) == 1
    assert "point B8 in image hill-2: wrong by about (1" in constrained[0]


@pytest.mark.parametrize("error", [(0.1, -0.1, 0.1), (0.0, 0.0, 1.0), (30.0, -200.0, 10.0)])
def test_reference_point_is_found_in_the_transformation(error: tuple[float, float, float]) -> None:
    case = hill(3, helmets=17)
    orientation = orient(_shifted(_without_start(case.network), 6, error))
    free, fit, constrained = _messages(orientation)
    assert len(fit) == 1
    assert "control point B7: wrong by about" in fit[0]
    assert (free, constrained) == ([], [])
    found = orientation.outcome.removed[0].blunder.estimate
    assert np.abs(found - error).max() < 0.1  # block 0.02 m, survey 0.012 m
    assert np.abs(_errors_in_sigmas(case, orientation)).max() < 4.0


def test_the_transformation_has_a_test_value_and_a_redundancy_number_for_each_coordinate() -> None:
    network = _without_start(hill(3, helmets=17).network)
    sound, spoilt = orient(network), orient(_shifted(network, 6, (0.0, 0.0, 0.5)))
    tests = sound.stages[1].tests
    assert len(tests) == 13  # of 15 points two have one ray only
    r, w = (np.array([getattr(test, name) for test in tests]) for name in ("r", "w"))
    assert r.sum() == pytest.approx(3 * len(tests) - 7)
    assert r.min() > 0.0
    assert r.max() < 1.0
    assert np.abs(w).max() < 3.5
    assert "B7" not in [test.point for test in spoilt.stages[1].tests]
    words = spoilt.stages[1].findings[0].message.split("w of X, Y, Z ")[1]
    single = [abs(float(value)) for value in words.split(",")[0].split()]
    assert max(single) == single[2]
    assert "redundancy numbers 0." in words


def test_several_errors_are_found_each_at_its_stage() -> None:
    network = _without_start(hill(4, helmets=17).network)
    network = _spoilt(_spoilt(network, 0, 3, (9.0, 20.0)), 2, 25, (4.0, -15.0))
    network = _shifted(_shifted(network, 6, (0.2, 0.3, -0.2)), 12, (-0.4, 0.2, 0.5))
    free, fit, constrained = _messages(orient(network))
    assert sorted(message.split(":")[0] for message in free) == ["point B4 in image hill-1", "point H5 in image hill-3"]
    assert sorted(message.split(":")[0] for message in fit) == ["control point B13", "control point B7"]
    assert constrained == []


def test_an_error_along_the_epipolar_line_is_found_with_the_survey_only() -> None:
    """Two images show the point: an error along the epipolar line appears only with the survey."""
    network = hill(1).network
    o, point = network.observations, 9
    left = ~((o.point == point) & (o.image == 2))
    parts = {name: getattr(o, name)[left] for name in ("image", "point", "xy", "sigma", "group")}
    network = replace(network, observations=replace(o, **parts))
    orientation = orient(_spoilt(network, 0, point, _epipolar(network, point) * 40.0))
    assert _messages(orientation) == [[], [], []]
    for stage in orientation.stages[1:]:
        message = stage.findings[0].message
        assert message.startswith("one of these observations is wrong")
        assert all(name in message for name in ("control point B10", "point B10 in image hill-1"))


def _epipolar(network: Network, point: int) -> np.ndarray:
    """Direction in image 0 in which the point moves along the ray of image 1."""
    case = hill(1)
    x, positions, rotation = case.truth.xyz[point], case.truth.position, nearest_rotation(case.truth.rotation[0])
    ends = [(x + step * (x - positions[1]) - positions[0]) @ rotation for step in (0.0, 0.01)]
    first, second = (-end[:2] / end[2] for end in ends)
    return np.asarray((second - first) / np.linalg.norm(second - first))


def test_a_reference_point_with_one_ray_is_judged_in_the_last_stage() -> None:
    """The free block lacks the point; the last stage cannot decide between its survey and its image point."""
    network = hill(1, helmets=17).network
    o, point = network.observations, 9
    left = ~((o.point == point) & (o.image != 1))
    parts = {name: getattr(o, name)[left] for name in ("image", "point", "xy", "sigma", "group")}
    orientation = orient(_spoilt(replace(network, observations=replace(o, **parts)), 1, point, (30.0, -30.0)))
    assert [len(stage.findings) > 0 for stage in orientation.stages] == [False, False, True]
    message = orientation.stages[2].findings[0].message
    assert message.startswith("one of these observations is wrong")
    assert "control point B10" in message
    assert "point B10 in image hill-2" in message


def test_three_reference_points_show_an_error_but_not_whose_it_is() -> None:
    """Their distances contradict the block; each of them may be the one that is wrong."""
    network = hill(1, helmets=17).network
    few = tuple(replace(p, role=Role.TIE, sigma=None) if 3 <= i < 15 else p for i, p in enumerate(network.points))
    orientation = orient(_shifted(replace(network, points=few), 1, (0.0, 0.0, 1.5)))
    assert _messages(orientation)[1] == []
    assert "cannot tell which" in orientation.stages[1].findings[0].message


def test_too_few_reference_points_leave_the_second_stage_out() -> None:
    network = hill(1).network
    few = replace(network, points=tuple(replace(p, role=Role.TIE, sigma=None) for p in network.points))
    few = replace(few, points=(*network.points[:3], *few.points[3:]))
    orientation = orient(few)
    assert orientation.stages[1].findings == ()
    assert orientation.outcome.adjustment.redundancy > 0


def test_interior_orientation_is_held_and_said() -> None:
    network = hill(1).network
    cameras = tuple(replace(camera, estimate=("c",)) for camera in network.cameras)
    orientation = orient(replace(network, cameras=cameras))
    assert orientation.outcome.adjustment.problem.unknowns.selection.size == 0
    assert "held" in orientation.notes[0]


def test_weights_are_estimated_where_the_network_asks_for_it() -> None:
    """Appendix D.3: the survey is five times worse than its sigmas say."""
    network = hill(2, helmets=17).network
    points = tuple(p if p.sigma is None else replace(p, sigma=p.sigma / 5.0) for p in network.points)
    orientation = orient(replace(network, points=points, reweight=Reweight.HELMERT))
    components = {part.group: part.factor for part in orientation.outcome.components or ()}
    assert components["control"] == pytest.approx(5.0, rel=0.5)  # 24 redundant: one sigma is 15 %
    assert components["image"] == pytest.approx(1.0, rel=0.25)


def test_error_free_reference_points() -> None:
    """No error-free reference point is accused: the covariance of the block is used in the tests."""
    case = hill(1, noise=1.0)
    points = tuple(
        replace(p, role=Role.FIXED, xyz=case.truth.xyz[i], sigma=None) if p.role is Role.CONTROL else p
        for i, p in enumerate(case.network.points)
    )
    network = replace(case.network, points=points)
    assert _messages(orient(network)) == [[], [], []]
    spoilt = _messages(orient(_shifted(network, 2, (0.5, 0.5, 0.5))))
    assert len(spoilt[1]) == 1
    assert "B3" in spoilt[1][0]


def test_what_cannot_be_done_is_said() -> None:
    network = hill(1).network
    with pytest.raises(BadInputError, match=r'no tie point is called "M\*"'):
        orient(network, alternative=1, moving="M*")
    held = replace(network, images=(replace(network.images[0], estimate=False), *network.images[1:]))
    with pytest.raises(BadInputError, match=r"images\.hill-1: the pose is constant"):
        orient(held)


def test_part_of_a_network_keeps_what_belongs_to_it() -> None:
    network = hill(1, helmets=17).network
    chosen = np.arange(len(network.points)) % 2 == 1
    part = only_points(network, chosen)
    assert [p.name for p in part.points] == [p.name for p, stays in zip(network.points, chosen, strict=True) if stays]
    assert rays(part).tolist() == rays(network)[chosen].tolist()
