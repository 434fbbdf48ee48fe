"""Jumps as they were found: a damaged log, and a jumper whose path was sighted in two parts."""

import numpy as np

from analysis.candidates.model import PulseCandidates
from analysis.measurements.model import ImageMeasurements, PointMeasurement, PulseMeasurements
from analysis.procedure.analyze import unread_pulses
from analysis.procedure.jump_search import one_of_each, without_gaps
from rig.clocks import UtcNs
from rig.pulse import PulseNumber


def test_pulses_that_cannot_be_read_have_an_entry_without_measurements() -> None:
    there = [PulseMeasurements(PulseNumber(n), UtcNs(1_000_000 * n), {}) for n in (7, 8, 11, 12)]
    whole = without_gaps(there)
    assert [pulse.pulse for pulse in whole] == [7, 8, 9, 10, 11, 12]
    assert [pulse.time for pulse in whole] == [1_000_000 * n for n in range(7, 13)]
    assert all(one is other for one, other in zip((whole[0], whole[-1]), (there[0], there[-1]), strict=True))


def test_pulses_that_cannot_be_read_are_said() -> None:
    def seen(*numbers: int) -> list[PulseCandidates]:
        return [PulseCandidates(PulseNumber(n), UtcNs(n), {}) for n in numbers]

    assert unread_pulses(seen(7, 8, 9)) == unread_pulses([]) == []
    (line,) = unread_pulses(seen(7, 9))
    assert line.text == "cannot be read from the log, which is damaged: pulses 8; svev verify says more"
    (line,) = unread_pulses(seen(7, 20))
    assert "pulses 8, 9, 10, 11, 12, 13, ...;" in line.text


def _measured(pulse: int, *points: str) -> PulseMeasurements:
    known = {name: PointMeasurement(np.zeros(2), np.eye(2)) for name in points}
    return PulseMeasurements(PulseNumber(pulse), UtcNs(pulse), {"K1": ImageMeasurements(known, {})})


def test_parts_of_a_path_that_share_pulses_are_one_jump() -> None:
    early = [_measured(n, "P1") for n in range(10, 30)]
    late = [_measured(n, "P1", "P2") for n in range(25, 40)]
    other = [_measured(n, "P1") for n in range(130, 150)]
    first, second = one_of_each([late, other, early])
    assert [pulse.pulse for pulse in first] == list(range(10, 40))
    assert [len(pulse.images["K1"].points) for pulse in first] == [1] * 15 + [2] * 15
    assert second == other


def test_jumps_one_after_the_other_stay_two() -> None:
    one, two = [_measured(n, "P1") for n in range(10, 30)], [_measured(n, "P1") for n in range(30, 50)]
    assert one_of_each([one, two]) == [one, two]
    assert one_of_each([]) == []
