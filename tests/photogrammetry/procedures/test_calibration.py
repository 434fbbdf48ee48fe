"""Calibration: true within its sigmas, doubtful parameters and gross errors named."""

from dataclasses import replace

import numpy as np
import pytest

from photogrammetry.geometry.camera_model import INTERIOR
from photogrammetry.network.model import Distance, Network, Role
from photogrammetry.procedures.calibration import calibrate
from rig.errors import BadInputError
from tests.photogrammetry.synthetic import Synthetic, lab_frame
from tests.support.repeats import repeats


def _without_start(case: Synthetic, factor: float = 1.0) -> Network:
    """Neither poses nor targets are known, and c is wrong."""
    network = case.network
    wrong = np.array([factor, *[1.0] * 9])
    return replace(
        network,
        cameras=tuple(replace(camera, interior=camera.interior * wrong) for camera in network.cameras),
        images=tuple(replace(image, position=None, rotation=None) for image in network.images),
        points=tuple(replace(p, xyz=None) for p in network.points),
    )


@pytest.mark.parametrize(("seed", "factor"), repeats([(3, 1.4), (1, 1.0), (2, 0.7)]))
def test_interior_orientation_is_true_within_its_sigmas(seed: int, factor: float) -> None:
    case = lab_frame(seed)
    calibration = calibrate(_without_start(case, factor))
    a = calibration.outcome.adjustment
    columns = a.problem.unknowns.camera
    error = (a.state.interior - case.truth.interior)[:, a.problem.unknowns.selection]
    assert np.abs(error / a.sigmas(columns)).max() < 4.5  # 12 numbers: a chance of 0.01 %
    assert calibration.outcome.removed == ()
    assert calibration.outcome.blunders == ()
    assert a.free.defect == 7


def test_a_scale_bar_gives_the_frame_its_size() -> None:
    case = lab_frame(2)
    length = float(np.linalg.norm(case.truth.xyz[0] - case.truth.xyz[1]))
    calibration = calibrate(replace(_without_start(case), distances=(Distance(0, 1, length, 1e-4),)))
    a = calibration.outcome.adjustment
    assert a.free.defect == 6
    assert np.linalg.norm(a.state.xyz[0] - a.state.xyz[1]) == pytest.approx(length, abs=1e-6)


def test_wrong_image_points_are_taken_out() -> None:
    network = lab_frame(3).network
    xy = network.observations.xy.copy()
    xy[40] += (3.0, -5.0)
    xy[300] += (-60.0, 80.0)
    calibration = calibrate(replace(network, observations=replace(network.observations, xy=xy)))
    assert sorted(gone.blunder.suspect.index for gone in calibration.outcome.removed) == [40, 300]
    assert calibration.outcome.blunders == ()


def test_doubtful_parameters_are_named() -> None:
    """The lens has no second radial term: its estimate is noise, and correlates with the first term."""
    network = lab_frame(4).network
    cameras = tuple(replace(c, estimate=tuple(p for p in INTERIOR if p in {"c", "a1", "a2"})) for c in network.cameras)
    notes = calibrate(replace(network, cameras=cameras)).notes
    assert any("a2" in note and "not significantly" in note for note in notes)
    assert any("a1 and a2 can hardly be told apart" in note for note in notes)


def test_the_survey_is_not_used_and_that_is_said() -> None:
    case = lab_frame(5, points=30)
    points = list(case.network.points)
    for i in range(5):  # a survey that is wrong by far
        points[i] = replace(points[i], role=Role.CONTROL, xyz=case.truth.xyz[i] * (1 + i), sigma=np.full(3, 1e-4))
    one, other = (calibrate(n) for n in (case.network, replace(case.network, points=tuple(points))))
    assert one.outcome.adjustment.vtpv == pytest.approx(other.outcome.adjustment.vtpv)
    assert one.outcome.adjustment.state.interior == pytest.approx(other.outcome.adjustment.state.interior, rel=1e-6)
    assert any("survey of 5 points is not used" in note for note in other.notes)


def test_a_surveyed_point_that_nobody_sees_is_left_out_and_named() -> None:
    network = lab_frame(5, points=30).network
    unseen = replace(network.points[0], name="far", role=Role.FIXED, xyz=np.array([9.0, 9.0, 9.0]))
    calibration = calibrate(replace(network, points=(*network.points, unseen)))
    assert "left out: far" in calibration.notes[0]


def test_what_cannot_be_done_is_said() -> None:
    network = lab_frame(1, points=10).network
    known = tuple(replace(camera, estimate=()) for camera in network.cameras)
    with pytest.raises(BadInputError, match="no camera estimates anything"):
        calibrate(replace(network, cameras=known))
    held = (replace(network.images[0], estimate=False), *network.images[1:])
    with pytest.raises(BadInputError, match=r"images\.lab-01: the pose is constant"):
        calibrate(replace(network, images=held))
