"""What was seen of each pulse in a damaged log, and which of it belongs together.

After damage a pulse may be seen several times, out of order, or in part. Its number and its time say where it belongs,
not its place in the file: the recovered log is the longest chain of pulses whose numbers and times both increase.
"""

from bisect import bisect_left
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from itertools import pairwise
from typing import Self

from rig.clocks import UtcNs
from rig.frame import FrameStatus
from rig.images.pixels import Pixels
from rig.pulse import PulseNumber
from rig.tag import CameraTag, TripletTag


class Rank(IntEnum):
    """How much of a pulse is there."""

    HEADS = 1  #: the heads of its messages: number and time
    TAG = 2  #: its tag, in damaged bytes
    WHOLE = 3  #: its tag, in a chunk with the right checksum, and its image, if it ever had one


@dataclass(frozen=True, slots=True)
class Constants:
    """What all tags of a recording have in common; the cameras as they are where no frame can be read."""

    session: str
    recording: str
    shape: tuple[int, int]
    pixels: Pixels
    cameras: tuple[CameraTag, ...]

    @classmethod
    def of(cls, tag: TripletTag) -> Self:
        """The constants of a tag."""
        damaged = FrameStatus.DAMAGED
        cameras = tuple(CameraTag(each.name, each.columns, damaged, rows=each.rows) for each in tag.cameras)
        return cls(tag.session, tag.recording, tag.shape, tag.pixels, cameras)

    def damaged_tag(self, pulse: PulseNumber, time: UtcNs) -> TripletTag:
        """The tag of a pulse of which only number and time are known: the frames of all cameras are damaged."""
        return TripletTag.made(pulse, time, self.session, self.recording, self.shape, self.cameras, self.pixels)


@dataclass(frozen=True, slots=True)
class Sighting:
    """One place of the file where something of a pulse stands.

    Attributes:
        pulse, time: number and time of the pulse.
        rank: how much of it is there.
        offset, length: where: a chunk, a tag, or the damaged bytes with the heads.
        constants: what its tag has in common with others; None without a tag.
        crc: checksum of its chunk, 0 without a whole one.
    """

    pulse: PulseNumber
    time: UtcNs
    rank: Rank
    offset: int
    length: int
    constants: Constants | None
    crc: int = 0


@dataclass(frozen=True, slots=True)
class Chain:
    """The pulses of the recovered log.

    Attributes:
        constants: what their tags have in common.
        pulses: one sighting of each, by pulse number.
        left_out: what was seen and is not in the chain, one sentence each.
    """

    constants: Constants
    pulses: list[Sighting]
    left_out: list[str]


def chain_of(sightings: Sequence[Sighting]) -> Chain | None:
    """Find the chain with the most whole pulses and, among those, the most tags; None if no tag was seen at all."""
    constants = _most_common(sightings)
    if constants is None:
        return None
    left_out = []
    candidates: dict[tuple[int, int], Sighting] = {}
    for sighting in sightings:
        if sighting.constants not in (constants, None):
            if sighting.rank is Rank.WHOLE:
                left_out.append(f"pulse {sighting.pulse}: its tag is of another recording or other cameras, left out")
                continue
            sighting = replace(sighting, rank=Rank.HEADS, constants=None)  # noqa: PLW2901  # its tag was hit
        key = (sighting.pulse, sighting.time)
        known = candidates.get(key)
        if known is None or sighting.rank > known.rank:
            candidates[key] = sighting
        elif known.rank == sighting.rank == Rank.WHOLE and known.crc != sighting.crc:
            left_out.append(f"pulse {sighting.pulse}: stands there twice with different content, the first one is kept")
    pulses = _longest(candidates.values())
    chosen = {sighting.pulse: sighting for sighting in pulses}
    for sighting in candidates.values():
        if sighting.pulse not in chosen or (sighting.rank is Rank.WHOLE and chosen[sighting.pulse] is not sighting):
            left_out.append(f"pulse {sighting.pulse}: its number or its time contradicts other pulses, left out")
    return Chain(constants, pulses, left_out)


def _most_common(sightings: Iterable[Sighting]) -> Constants | None:
    """The constants of most whole pulses or, if none is whole, of most tags; the first of several."""
    counts: dict[Rank, Counter[Constants]] = {rank: Counter() for rank in Rank}
    for sighting in sightings:
        if sighting.constants is not None:
            counts[sighting.rank][sighting.constants] += 1
    most = (counts[Rank.WHOLE] or counts[Rank.TAG]).most_common(1)
    return most[0][0] if most else None


def _longest(candidates: Iterable[Sighting]) -> list[Sighting]:
    """The heaviest of the chains in which number and time increase: a whole pulse outweighs all tags, a tag all heads.

    Takes the candidates by number, and keeps for each time the heaviest chain that ends by then (in a Fenwick tree, so
    that it takes n log n steps).
    """
    ordered = sorted(candidates, key=lambda sighting: (sighting.pulse, -sighting.time))
    if all(one.pulse < other.pulse and one.time < other.time for one, other in pairwise(ordered)):
        return ordered
    more = len(ordered) + 1
    weights = {Rank.WHOLE: more * more, Rank.TAG: more, Rank.HEADS: 1}
    times = sorted({sighting.time for sighting in ordered})
    tree: list[tuple[int, int]] = [(0, -1)] * (len(times) + 1)  # weight of a chain, place of its last pulse
    before: list[int] = []
    last = (0, -1)
    for place, sighting in enumerate(ordered):
        node = bisect_left(times, sighting.time)
        heaviest = (0, -1)
        earlier = node
        while earlier:
            heaviest = max(heaviest, tree[earlier])
            earlier -= earlier & -earlier
        before.append(heaviest[1])
        chain = (heaviest[0] + weights[sighting.rank], place)
        node += 1
        while node < len(tree):
            tree[node] = max(tree[node], chain)
            node += node & -node
        last = max(last, chain)
    chain_back = []
    place = last[1]
    while place >= 0:
        chain_back.append(ordered[place])
        place = before[place]
    return chain_back[::-1]
