import math

import numpy as np
import pytest

from simrig.world.jumper import FLIGHT_X_M, Jump, JumpSeries
from simrig.world.scenario import Scenario, Variation
from simrig.world.truth import angles, ski_line

TIMES = np.arange(-0.15, 0.8, 0.05)


@pytest.fixture(scope="module")
def jump(training: Scenario) -> Jump:
    there = JumpSeries(training).at(1.0)
    assert there is not None
    return there[0]


def test_the_jumper_takes_off_at_the_edge_with_the_papers_speed(jump: Jump) -> None:
    assert jump.origin(0.0)[:2] == pytest.approx((0, 0))
    assert np.linalg.norm(jump.velocity(-0.001)) == pytest.approx(26.0, abs=0.6)
    assert np.linalg.norm(jump.velocity(0.5)) == pytest.approx(26.0, abs=1.0)


def test_the_middle_of_the_skis_moves_without_a_jerk(jump: Jump) -> None:
    assert jump.velocity(-1e-3) == pytest.approx(jump.velocity(1e-3), abs=0.2)


def test_before_the_edge_the_skis_stand_on_the_table(jump: Jump, training: Scenario) -> None:
    slope = math.radians(training.hill.table_angle_deg)
    for time in (-0.2, -0.1, 0.0):
        x, _, z = jump.origin(time)
        assert z + math.tan(slope) * x == pytest.approx(0.03)
        assert angles(jump.pose(time)).phi == pytest.approx(-11.0)


def test_twenty_metres_take_about_four_fifths_of_a_second_and_end_above_the_ground(jump: Jump) -> None:
    end = next(t for t in np.arange(0, 2, 0.001) if jump.origin(t)[0] >= FLIGHT_X_M[1])
    assert end == pytest.approx(0.8, abs=0.04)
    assert -5.2 < jump.origin(end)[2] < -3.8


@pytest.mark.parametrize("time", TIMES)
def test_the_dynamic_system_is_that_of_figure_6(jump: Jump, time: float) -> None:
    pose = jump.pose(time)
    assert pose.axes @ pose.axes.T == pytest.approx(np.eye(3), abs=1e-12)
    assert pose.axes[0] == pytest.approx(pose.skis.sum(axis=0) / np.linalg.norm(pose.skis.sum(axis=0)))
    in_system = (pose.markers - pose.origin) @ pose.axes.T
    assert in_system[:2, 1] == pytest.approx(0, abs=1e-12)  # Y'(P1) = 0, and the hip in the same plane
    assert in_system[2] == pytest.approx(-in_system[3])
    assert in_system[3, 1] > 0.15  # P4 is the left ski's


@pytest.mark.parametrize("time", TIMES)
def test_the_angles_are_those_of_the_keyframes(jump: Jump, time: float) -> None:
    found, posture = angles(jump.pose(time)), jump.posture
    legs, torso = posture.leg_angle(time), posture.torso_angle(time)
    assert found.alpha == pytest.approx(legs)
    assert found.beta == pytest.approx(180 - legs + torso)
    assert found.gamma == pytest.approx(posture.ski_opening(time), abs=0.1)
    assert found.dphi == pytest.approx(posture.ski_slope_difference(time), abs=0.1)
    assert found.phi == pytest.approx(posture.ski_slope(time))


def test_the_skis_open_to_a_v_with_the_tips_apart(jump: Jump) -> None:
    assert angles(jump.pose(0.0)).gamma == pytest.approx(0, abs=1e-6)
    assert angles(jump.pose(0.75)).gamma > 20
    right, left = jump.pose(0.75).skis
    assert right[1] < 0 < left[1]


def test_the_ski_line_of_c8_holds_its_points(jump: Jump) -> None:
    pose = jump.pose(0.6)
    for point, along in zip(pose.markers[2:], pose.skis, strict=True):
        line = ski_line(point, along)
        for s in (-1.3, 0.0, 1.3):
            x, y, z = point + s * along
            assert (line.alpha * x + line.gamma, line.beta * x + line.delta) == pytest.approx((z, y))


def test_jumps_differ_by_the_seed_and_are_the_same_again(training: Scenario) -> None:
    def third(scenario: Scenario) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
        there = JumpSeries(scenario).at(9.5)
        assert there is not None
        return there[0].pose(0.5).markers

    there = JumpSeries(training).at(1.5)
    assert there is not None
    first = there[0].pose(0.5).markers
    assert np.array_equal(third(training), third(training))
    assert np.abs(third(training) - first).max() > 0.01
    assert np.abs(third(training) - first).max() < 1.0
    assert not np.array_equal(third(training), third(training.model_copy(update={"seed": 5})))


def test_without_variation_all_jumps_are_one(training: Scenario) -> None:
    none = Variation(speed_m_s=0, takeoff_angle_deg=0, lift=0, posture_deg=0, side_m_s=0, yaw_deg=0)
    series = JumpSeries(training.model_copy(update={"variation": none}))
    first, second = series.at(1.5), series.at(5.5)
    assert first is not None
    assert second is not None
    assert (first[0].number, second[0].number) == (0, 1)
    assert first[0].pose(first[1]).markers == pytest.approx(second[0].pose(second[1]).markers)


def test_between_jumps_nobody_is_in_sight(training: Scenario) -> None:
    series = JumpSeries(training)
    assert [series.at(t) is None for t in (0.0, 0.9, 1.0, 1.8, 3.0, 4.9)] == [True, False, False, False, True, False]
