"""Where a ski may be that is expected: a search for traces needs to look nowhere else.

A ski that is known within its own width is fitted at once. One that is known less well, since it turns or was not seen
for a moment, is sought, but only lines of its direction and contrast that lie near enough can be it. And where only one
of both skis can be, a line is one ski: two that nearly cover each other need not be tried there.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from analysis.candidates.model import EXPECTED_SIGMAS, ExpectedSki
from rig.arrays import Floats


@dataclass(frozen=True, slots=True, eq=False)
class Corridor:
    """Where the axis of a ski may be, px of a part of an image.

    Attributes:
        begin: (2,) one end of where it is expected.
        along: (2,) unit vector to the other end.
        length: from end to end.
        reach: across, to both sides.
        sign: of the contrast.
    """

    begin: Floats
    along: Floats
    length: float
    reach: float
    sign: int

    @classmethod
    def of(cls, ski: ExpectedSki, corner: tuple[int, int]) -> "Corridor":
        """That of an expected ski; `corner` is the first column and row of the part."""
        step = ski.ends[1] - ski.ends[0]
        length = max(1e-9, float(np.hypot(*step)))
        reach = EXPECTED_SIGMAS * ski.sigma + ski.width
        return cls(ski.ends[0] - corner, step / length, length, reach, 1 if ski.brighter else -1)

    def leads(self, steepest: float, *, steep: bool) -> bool:
        """Whether a line in it may be no steeper than that, in rows over columns or, if steep, the other way round."""
        across, ahead = np.abs(self.along if steep else self.along[::-1]).tolist()
        angle, spare = np.arctan2(across, ahead), np.arctan2(2 * self.reach, self.length)
        return bool(angle - spare <= np.arctan(steepest))

    def holds(self, ends: Floats) -> bool:
        """Whether a line with such ends (2, 2) lies in it."""
        off = ends - self.begin
        place, aside = off @ self.along, off @ np.array((-self.along[1], self.along[0]))
        return bool(np.abs(aside).max() < self.reach and place.max() > 0 and place.min() < self.length)


def one_each(corridors: Sequence[Corridor], lines: Sequence[Floats]) -> bool:
    """Whether each of some lines, ends (2, 2), lies in one corridor alone, which holds none of the others."""
    own = [[i for i, corridor in enumerate(corridors) if corridor.holds(ends)] for ends in lines]
    return all(len(of) == 1 for of in own) and len({of[0] for of in own}) == len(own)
