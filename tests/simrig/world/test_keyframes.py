import pytest
from hypothesis import given
from hypothesis import strategies as st

from simrig.world.keyframes import Curve, Keyframe

KEYFRAMES = st.lists(
    st.tuples(st.integers(-50, 50), st.floats(-100, 100)), min_size=1, max_size=6, unique_by=lambda frame: frame[0]
).map(lambda frames: sorted((time / 10, value) for time, value in frames))


@given(KEYFRAMES)
def test_the_curve_meets_its_keyframes(frames: list[Keyframe]) -> None:
    curve = Curve.through(frames)
    for time, value in frames:
        assert curve(time) == pytest.approx(value, abs=1e-9)


@given(KEYFRAMES, st.floats(-10, 10))
def test_the_curve_never_overshoots(frames: list[Keyframe], time: float) -> None:
    after = next((i for i, (t, _) in enumerate(frames) if t >= time), len(frames) - 1)
    around = [frames[max(0, after - 1)][1], frames[after][1]]
    if time < frames[0][0] or time > frames[-1][0]:
        around = [frames[0 if time < frames[0][0] else -1][1]]
    assert min(around) - 1e-9 <= Curve.through(frames)(time) <= max(around) + 1e-9


@given(KEYFRAMES)
def test_the_slope_has_no_jumps(frames: list[Keyframe]) -> None:
    curve, h = Curve.through(frames), 1e-6
    for time, value in frames:
        left, right = (value - curve(time - h)) / h, (curve(time + h) - value) / h
        assert left == pytest.approx(right, abs=0.2)
