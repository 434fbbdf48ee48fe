"""What hardly moves is told from what may be a jumper."""

import numpy as np

from analysis.candidates.foreground.background import Region
from analysis.candidates.foreground.pace import Pace
from rig.clocks import NS_PER_S, UtcNs

_RATE_HZ = 30


def _region(x: float, y: float, width: int, height: int) -> Region:
    layer = np.zeros((height, width), np.float32)
    return Region(round(x), round(y), layer, layer, layer, layer, layer > 0)


def test_people_are_still_and_a_jumper_is_not() -> None:
    """40 px are 1 m: an official walks by 1.5 m/s, the slowest jumper moves by 12 m/s."""
    pace = Pace()
    told = []
    for k in range(8):
        step = 40 / _RATE_HZ * k
        official, jumper = _region(300 + 1.5 * step, 200, 30, 70), _region(12 * step, 100 + 3 * step, 100, 80)
        regions = [jumper, official] if k % 2 else [official, jumper]
        told.append(pace.still(UtcNs(round(k / _RATE_HZ * NS_PER_S)), regions)[:: -1 if k % 2 else 1].tolist())
    assert told[:3] == [[False, False]] * 3, "nothing is known of the moment a tenth of a second ago"
    assert told[3:] == [[True, False]] * 5


def test_after_a_pause_nothing_is_still() -> None:
    pace = Pace()
    assert not pace.still(UtcNs(0), [_region(0, 0, 40, 40)]).any()
    assert not pace.still(UtcNs(NS_PER_S), [_region(0, 0, 40, 40)]).any()
    assert len(pace.still(UtcNs(2 * NS_PER_S), [])) == 0
