"""The benchmark of gross errors: no spoilt hill ends in a wrong result, and nothing sound is taken out."""

import pytest

from bench.photogrammetry.gross_errors import run_gross_errors

pytestmark = pytest.mark.long


def test_no_result_is_wrong() -> None:
    kinds = ("sound", "1 survey point", "2 exchanges in the survey", "2 cameras exchanged, poses given")
    sound, point, exchange, cameras = run_gross_errors(3, kinds)
    assert [case["wrong"] for case in (sound, point, exchange, cameras)] == [0, 0, 0, 0]
    assert sound["innocents"] == sound["refused"] == 0
    assert exchange["removed"] + exchange["named"] == exchange["culprits"] == 12
    assert cameras["refused"] == 3
