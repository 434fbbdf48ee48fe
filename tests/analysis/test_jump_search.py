"""A damaged log: the jump goes on over the pulses that cannot be read."""

from analysis.candidates.model import PulseCandidates
from analysis.measurements.model import PulseMeasurements
from analysis.procedure.analyze import unread_pulses
from analysis.procedure.jump_search import without_gaps
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
    assert line == "pulse 8 cannot be read from the log: it is damaged; svev verify says more"
    (line,) = unread_pulses(seen(7, 20))
    assert line.startswith("pulses 8, 9, 10, 11, 12, 13, ... cannot be read")
