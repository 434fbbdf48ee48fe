"""An exposure that lasts longer than the time between two pulses is found before the recording."""

import pytest

from svev.doctor.cameras.exposure import look_at_exposures
from svev.doctor.finding import Level
from tests.support.rigs import SIM


@pytest.mark.parametrize(
    ("exposure_us", "level", "what"),
    [
        (40_000, Level.FAIL, "K2: it exposes for 40.0 ms, pulses come every 33.3 ms"),
        (33_000, Level.PASS, "exposures take 33.0 ms at most, pulses come every 33.3 ms"),
    ],
)
def test_exposures_are_compared_with_the_period(exposure_us: float, level: Level, what: str) -> None:
    first, second, third = SIM.cameras
    second = second.model_copy(update={"exposure_us": exposure_us})
    rig = SIM.model_copy(update={"cameras": (first, second, third)})
    (found,) = look_at_exposures(rig)
    assert (found.level, found.what) == (level, what)
