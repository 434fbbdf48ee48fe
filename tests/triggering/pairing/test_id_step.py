import pytest
from hypothesis import given
from hypothesis import strategies as st

from triggering.pairing.camera.frame_ids import id_step


@pytest.mark.parametrize(
    ("previous", "current", "modulus", "step"),
    [
        (1, 2, 65535, 1),
        (65534, 65535, 65535, 1),
        (65535, 1, 65535, 1),  # 0 is skipped
        (65535, 2, 65535, 2),
        (65533, 3, 65535, 5),
        (7, 7, 65535, 0),
        (7, 5, 65535, -2),
        (2, 65535, 65535, -2),
        (65535, 65536, 0, 1),  # 64-bit ids go on
        (2**63, 2**63 + 3, 0, 3),
        (500, 1, 0, -499),
    ],
)
def test_step(previous: int, current: int, modulus: int, step: int) -> None:
    assert id_step(previous, current, modulus) == step


@given(first=st.integers(1, 65535), frames=st.integers(-30_000, 30_000))
def test_step_counts_the_frames_that_a_camera_took(first: int, frames: int) -> None:
    # The camera's own rule, `id % 65535 + 1`, applied `frames` times.
    current = (first - 1 + frames) % 65535 + 1
    assert id_step(first, current, 65535) == frames
