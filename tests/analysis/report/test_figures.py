"""Numbers for people: rounding by sigma, and the five numbers at the right place."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.report.course import Course, course_of
from analysis.report.figures import five_figures, plus_minus
from analysis.result.model import Jump, PointState, PulseState, Quantity, SmoothedState, Vector
from photogrammetry.geometry.rotation import rotation_from_vector
from rig.arrays import Floats
from tests.analysis.report.jumps import measured_recording
from tests.analysis.result.recordings import TAKEOFF_SIGMA_PULSES, without_takeoff
from tests.analysis.simulated import RATE_HZ


@pytest.mark.parametrize(
    ("value", "sigma", "unit", "text"),
    [
        (26.1234, 0.134, "m/s", "26.12 ± 0.13 m/s"),
        (26.1234, 0.34, "m/s", "26.1 ± 0.3 m/s"),
        (-3.14159, 0.0961, "°", "\N{MINUS SIGN}3.1° ± 0.10°"),
        (44.4, 1.96, "°", "44° ± 2°"),
        (144.4, 27.0, "°", "144° ± 27°"),
        (-0.04, 0.5, "m", "0.0 ± 0.5 m"),
        (1.0, np.nan, "m", "1.0 ± \N{EN DASH} m"),
    ],
)
def test_a_number_has_the_digits_that_its_sigma_allows(value: float, sigma: float, unit: str, text: str) -> None:
    assert plus_minus(Quantity(value, sigma), unit) == text


def test_no_number_is_a_dash() -> None:
    assert plus_minus(None, "m") == "\N{EN DASH}"


def _course(jump: Jump) -> Course:
    return course_of(jump, RATE_HZ)


def test_the_five_numbers_are_those_of_the_smoothed_jump() -> None:
    jump = measured_recording().jumps[0]
    five = five_figures(_course(jump), Quantity(2.3, 0.1))
    states = [pulse.smoothed for pulse in jump.pulses]
    since = [pulse.since_takeoff_s for pulse in jump.pulses]
    speed = [state.speed.value for state in states if state is not None and state.speed is not None]
    alpha = [state.angles["alpha"].value for state in states if state is not None and state.angles["alpha"]]
    attack = [state.angle_of_attack.value for state in states if state is not None and state.angle_of_attack]
    found = [figure.quantity.value for figure in five if figure.quantity is not None]
    # 20 m at 26 m/s are passed 0.77 s after the take-off.
    expected = [np.interp(0, since, speed), 2.3, np.interp(20 / 26.0, since, speed)]
    assert found[:3] == pytest.approx(expected, abs=0.02)
    assert found[3:] == pytest.approx([np.interp(0.5, since, attack), np.interp(0.5, since, alpha)], abs=1e-9)


def test_the_uncertain_take_off_adds_to_the_sigma_of_what_changes_fast() -> None:
    jump = measured_recording().jumps[0]
    course = _course(jump)
    found = course.at_time("angle_of_attack", 0.5)
    assert found is not None
    at = int(np.searchsorted(course.since, 0.5))
    series = course.smoothed["angle_of_attack"]
    change = (series.value[at] - series.value[at - 1]) * TAKEOFF_SIGMA_PULSES  # degrees in one sigma of the take-off
    assert found.sigma == pytest.approx(np.hypot(series.sigma[at - 1 : at + 1].mean(), change), rel=0.05)


def test_distances_do_not_depend_on_where_the_survey_has_its_axes() -> None:
    jump = measured_recording().jumps[0]
    turn, shift = rotation_from_vector(np.array((0.0, 0.0, 2.4))), np.array((1000.0, -500.0, 300.0))
    moved = replace(jump, pulses=tuple(_moved(pulse, turn, shift) for pulse in jump.pulses))
    assert _course(moved).distance == pytest.approx(_course(jump).distance, abs=1e-8)
    place = _course(jump).at_distance("speed", 20.0)
    again = _course(moved).at_distance("speed", 20.0)
    assert place is not None
    assert again is not None
    assert again.value == pytest.approx(place.value)


def _moved(pulse: PulseState, turn: Floats, shift: Floats) -> PulseState:
    state = pulse.smoothed
    assert isinstance(state, SmoothedState)
    points = {
        name: point and PointState(turn @ point.xyz + shift, point.covariance, point.cameras, point.status)
        for name, point in state.points.items()
    }
    origin = Vector(turn @ state.origin.value + shift, state.origin.covariance)
    return replace(pulse, smoothed=replace(state, points=points, origin=origin))


def test_what_is_not_known_is_not_given() -> None:
    jump = measured_recording().jumps[0]
    short = replace(jump, pulses=jump.pulses[:20])
    names = [figure.quantity is not None for figure in five_figures(_course(short), None)]
    assert names == [True, False, False, False, False]
    (gone,) = without_takeoff(measured_recording()).jumps
    assert all(figure.quantity is None for figure in five_figures(_course(gone), None))
    assert not len(_course(replace(jump, pulses=())).since)


def test_nothing_is_interpolated_across_a_gap() -> None:
    jump = measured_recording().jumps[0]
    at = next(i for i, pulse in enumerate(jump.pulses) if pulse.since_takeoff_s > 0.5)
    without = (*jump.pulses[: at - 1], *jump.pulses[at + 1 :])
    assert _course(replace(jump, pulses=without)).at_time("alpha", 0.5) is None
