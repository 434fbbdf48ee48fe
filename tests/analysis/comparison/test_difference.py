"""What is found different, and how often, in jumps whose truth is known."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.comparison.aligned import RATES, MeasuredJump, Series, common_times, measured_jump, series
from analysis.comparison.alignment import align
from analysis.comparison.difference import LEVEL, Difference
from analysis.comparison.difference import difference as difference_of
from analysis.comparison.repeatability import noise_covariance
from analysis.comparison.scatter import scatter
from analysis.comparison.shared_calibration import Common, shared_calibration
from analysis.result.model import QUANTITIES, MeasuredRecording, PulseState
from rig.arrays import Flags, Floats
from rig.errors import BadInputError
from tests.analysis.result.recordings import calibration_error, recording, without_takeoff

COMPARISONS = 32
FEW = 400  #: draws; the limit is known to 2 % from them
HEIGHT = QUANTITIES.index("height")
VERTICAL = np.array(QUANTITIES) == "velocity_z"


def measured(seed: int = 0, leg_deg: float = 0.0, error: Floats | None = None, source: str = "one") -> MeasuredJump:
    given = recording(seed=seed, leg_deg=leg_deg, calibration_error=error, source=source)
    return measured_jump(given, 1, f"jump {seed}")


def pulses(jump: MeasuredJump) -> tuple[PulseState, ...]:
    return jump.jump.pulses


def difference(a: MeasuredJump, b: MeasuredJump, draws: int = FEW) -> Difference:
    return difference_of(align([a, b]), draws)


@pytest.fixture(scope="module")
def repeated() -> list[Difference]:
    """The same jump measured twice, each pair with another calibration that both have in common."""
    return [
        difference(measured(2 * i, error=calibration_error(i)), measured(2 * i + 1, error=calibration_error(i)))
        for i in range(COMPARISONS)
    ]


@pytest.mark.long
def test_the_same_jump_is_rarely_found_different(repeated: list[Difference]) -> None:
    """Of 32 comparisons 1.6 are expected; more than 6 come with a probability of 0.1 %."""
    assert sum(bool(d.found()) for d in repeated) <= 6


def test_differences_of_repeated_measurements_have_the_stated_sigma(repeated: list[Difference]) -> None:
    """Some 32 x 10 independent values know a mean square to 8 %; the model of the smoother adds to it."""
    z = np.concatenate([d.value / d.repeat for d in repeated], axis=1)
    squares = np.nanmean(z**2, axis=1)
    others = np.arange(len(QUANTITIES)) != HEIGHT  # the height is given the most that its errors can be
    assert squares[others].min() > 0.6
    assert squares.max() < 1.3
    assert all((d.repeat <= d.sigma * np.sqrt(1.3)).all() for d in repeated)


def test_a_change_is_found_as_often_as_predicted(repeated: list[Difference]) -> None:
    """With 80 % predicted, 24 comparisons find 19 ± 2."""
    power = repeated[0].power["alpha"]
    assert power is not None
    pairs = [difference(measured(i), measured(1000 + i, leg_deg=power.change_80)) for i in range(24)]
    assert 13 <= sum("alpha" in d.found() for d in pairs) <= 23


def test_errors_of_one_calibration_cancel_and_those_of_two_count() -> None:
    """24 draws know a mean square to 29 %."""
    errors = [calibration_error(i) for i in range(48)]
    same = difference(measured(1, error=errors[0]), measured(2, error=errors[0]))
    without = difference(measured(1), measured(2))
    assert same.value == pytest.approx(without.value, abs=2e-3)  # what is left is not linear
    two = [
        difference(measured(i, error=errors[2 * i]), measured(99 + i, error=errors[2 * i + 1], source="other"), 50)
        for i in range(24)
    ]
    assert (same.common, two[0].common) == (Common.CALIBRATION, Common.NOTHING)
    middle = len(two[0].times) // 2
    assert two[0].repeat[HEIGHT, middle] > 1.1 * same.repeat[HEIGHT, middle]
    z = np.array([d.value[HEIGHT, middle] / d.repeat[HEIGHT, middle] for d in two])
    assert 0.25 < np.mean(z**2) < 2.0


def test_recordings_with_one_survey_share_its_errors() -> None:
    def surveyed(jump: MeasuredJump, source: str, part: float) -> MeasuredJump:
        orientation = jump.recording.orientation
        changed = replace(orientation, source=source, given="survey", given_covariance=part * orientation.covariance)
        return replace(jump, recording=replace(jump.recording, orientation=changed))

    one, other = measured(1), measured(2)
    a, b = surveyed(one, "a", 0.9), surveyed(other, "b", 0.9)
    shared = shared_calibration([a.recording, b.recording])
    assert shared.common is Common.SURVEY
    assert shared.own[1] == pytest.approx(0.1 * one.recording.orientation.covariance)
    found = [
        difference(*pair).repeat for pair in ((one, other), (a, b), (surveyed(one, "a", 0), surveyed(other, "b", 0)))
    ]
    middle = found[0].shape[1] // 2
    squares = np.array([repeat[HEIGHT, middle] ** 2 for repeat in found])
    assert squares[0] < squares[1] < squares[2]
    # errors of the calibration that are not shared add their own variances, a tenth of those of the whole
    assert squares[1] - squares[0] == pytest.approx((squares[2] - squares[0]) / 10, rel=0.15)


def test_jumps_are_aligned_at_the_place_of_the_edge() -> None:
    """O passes the edge at 26 m/s with a sigma of some mm: times agree to 0.3 ms, whatever each jump says itself."""
    one, other = measured(1), measured(2)
    late = replace(
        one,
        jump=replace(
            one.jump, pulses=tuple(replace(p, since_takeoff_s=p.since_takeoff_s - 0.002) for p in pulses(one))
        ),
    )
    found = align([late, other])
    assert found.at_one_place
    assert found.shared_sigma_s == pytest.approx(0.001 / np.sqrt(2), rel=0.1)
    a, b = (jump.since_takeoff() + jump.jump.pulses[0].pulse / -30 for jump in found.jumps)
    assert a == pytest.approx(b, abs=0.001)
    assert all(0 < jump.takeoff_sigma_s < 0.0003 for jump in found.jumps)
    expected = difference(one, other)
    assert difference(late, other).value == pytest.approx(expected.value, abs=0.2, nan_ok=True)


def test_jumps_of_two_hills_keep_their_own_take_offs() -> None:
    one, other = measured(1), measured(2)
    away = replace(
        one,
        jump=replace(
            one.jump,
            pulses=tuple(
                replace(
                    p,
                    smoothed=p.smoothed
                    and replace(p.smoothed, origin=replace(p.smoothed.origin, value=p.smoothed.origin.value + 5)),
                )
                for p in pulses(one)
            ),
        ),
    )
    found = align([away, other])
    assert not found.at_one_place
    assert found.jumps == [away, other]
    vague = align([replace(away, takeoff_sigma_s=0.01), other])
    sharp, blurred = difference_of(found, FEW), difference_of(vague, FEW)
    change = series(away, blurred.times).change
    expected = np.sqrt(sharp.repeat**2 + change**2 * (0.01**2 - away.takeoff_sigma_s**2))
    others = np.arange(len(QUANTITIES)) != HEIGHT  # its errors are taken to go with those of the place of the edge
    assert blurred.repeat[others] == pytest.approx(expected[others], rel=1e-6)
    assert (blurred.repeat >= expected * (1 - 1e-6)).all()


def test_the_greatest_of_all_is_judged_as_the_greatest(repeated: list[Difference]) -> None:
    d = repeated[0]
    count = np.isfinite(d.value).sum()
    assert 11 < d.independent < count  # neighbours in time tell the same
    z = np.abs(d.value / d.repeat)
    assert ((d.p_greatest < LEVEL) == (z > d.limit)).all()
    assert (d.p_greatest >= d.p).all()


def test_a_quantity_that_was_not_measured_is_left_out() -> None:
    one = measured(1)
    without = tuple(
        replace(p, smoothed=p.smoothed and replace(p.smoothed, angle_of_attack=None, angles={"alpha": None}))
        for p in one.jump.pulses
    )
    d = difference(replace(one, jump=replace(one.jump, pulses=without)), measured(2))
    assert np.isnan(d.value[:6]).all()
    assert np.isfinite(d.value[6:]).all()
    assert d.power["alpha"] is None
    assert d.power["height"] is not None
    assert d.greatest(0) is None


def test_errors_of_measurement_are_five_sixths_of_the_variance_of_values_and_half_of_that_of_rates() -> None:
    assert _noise_variance(at_s=3.0) == pytest.approx(1.3 * np.where(RATES, 1 / 2, 5 / 6), abs=0.02)


@pytest.mark.parametrize(("at_s", "whole"), [(-0.1, RATES), (0.0, RATES), (0.2, VERTICAL)])
def test_next_to_the_edge_all_of_the_variance_of_rates_is_of_measurement(at_s: float, whole: Flags) -> None:
    """Before the take-off that of all of them, behind it that of what changes when the table ends."""
    expected = 1.3 * np.where(whole, 1, np.where(RATES, 1 / 2, 5 / 6))
    assert _noise_variance(at_s) == pytest.approx(expected, abs=0.02)


def _noise_variance(at_s: float) -> Floats:
    """(11,) at a time since the take-off, of stated variances of 1 and a smoother that reaches far."""
    count = len(QUANTITIES)
    shape = (count, 1)
    series = Series(
        np.array([at_s]),
        np.zeros(shape),
        np.zeros(shape),
        np.ones(shape),
        np.zeros((*shape, 1)),
        np.full(shape, 0.05),
        np.eye(count + 1),
        0.0,
        30.0,
        (-9.0, 9.0),
    )
    return noise_covariance(series).diagonal()


def test_own_scatter_is_that_within_the_athletes() -> None:
    jumps = [
        measured_jump(replace(recording(seed=seed), session={"athlete": name}), 1, name)
        for seed, name in enumerate("AABBC")
    ]
    times = common_times(jumps)
    found = scatter(jumps, times)
    assert found is not None
    assert (found.jumps, found.freedom) == (4, 2)
    values = np.stack([series(jump, times).values for jump in jumps])
    expected = np.sqrt((np.var(values[:2], axis=0) + np.var(values[2:4], axis=0)) * 2 / 2)
    assert found.deviation == pytest.approx(expected, nan_ok=True)
    # with two degrees of freedom P(|t| > 4.303) = 5 %
    assert found.p(4.303 * np.sqrt(2) * found.deviation) == pytest.approx(0.05, abs=1e-3)
    assert scatter([jumps[0], jumps[2], jumps[4]], times) is None


def test_a_jump_that_cannot_be_aligned_is_refused() -> None:
    whole: MeasuredRecording = recording(1)
    with pytest.raises(BadInputError, match="jump 1 has no take-off"):
        measured_jump(without_takeoff(whole), 1, "monday")
    with pytest.raises(BadInputError, match=r"monday: has no jump 3 \(it has 1\)"):
        measured_jump(whole, 3, "monday")
    jump = measured_jump(whole, 1, "monday")
    later = tuple(replace(p, since_takeoff_s=p.since_takeoff_s + 5) for p in jump.jump.pulses)
    with pytest.raises(BadInputError, match="same times since the take-off"):
        difference(jump, replace(jump, jump=replace(jump.jump, pulses=later)))
