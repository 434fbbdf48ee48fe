"""Choosing among what was seen of pulses: the chain that keeps most of them."""

from itertools import combinations, pairwise

from hypothesis import given
from hypothesis import strategies as st

from recorder.recovering.sightings import Constants, Rank, Sighting, chain_of
from rig.clocks import UtcNs
from rig.pulse import PulseNumber
from tests.recorder.logs import make_tag

CONSTANTS = Constants.of(make_tag(1))


def _seen(pulse: int, time: int, rank: Rank = Rank.WHOLE, offset: int = 0) -> Sighting:
    constants = None if rank is Rank.HEADS else CONSTANTS
    return Sighting(PulseNumber(pulse), UtcNs(time), rank, offset, 10, constants, 1)


def _weights(chain: list[Sighting]) -> tuple[int, ...]:
    return tuple(sum(sighting.rank is rank for sighting in chain) for rank in reversed(Rank))


@given(
    sightings=st.lists(
        st.builds(_seen, st.integers(1, 7), st.integers(1, 7), st.sampled_from(Rank), st.integers(0, 3)), max_size=8
    )
)
def test_no_other_chain_keeps_more(sightings: list[Sighting]) -> None:
    chain = chain_of(sightings)
    if chain is None:
        assert all(sighting.rank is Rank.HEADS for sighting in sightings)
        return
    best = max(
        _weights(list(some))
        for count in range(len(sightings) + 1)
        for some in combinations(sorted(sightings, key=lambda sighting: sighting.pulse), count)
        if all(a.pulse < b.pulse and a.time < b.time for a, b in pairwise(some))
    )
    assert _weights(chain.pulses) == best
    assert all(a.pulse < b.pulse and a.time < b.time for a, b in pairwise(chain.pulses))


def test_a_pulse_with_a_false_time_costs_no_other() -> None:
    chain = chain_of([_seen(1, 10), _seen(2, 900), _seen(3, 30), _seen(4, 40)])
    assert chain is not None
    assert [sighting.pulse for sighting in chain.pulses] == [1, 3, 4]
    assert chain.left_out == ["pulse 2: its number or its time contradicts other pulses, left out"]


def test_the_place_in_the_file_does_not_matter() -> None:
    chain = chain_of([_seen(3, 30, offset=1), _seen(1, 10, offset=2), _seen(3, 30, offset=3), _seen(2, 20, offset=4)])
    assert chain is not None
    assert [(sighting.pulse, sighting.offset) for sighting in chain.pulses] == [(1, 2), (2, 4), (3, 1)]
    assert chain.left_out == []
