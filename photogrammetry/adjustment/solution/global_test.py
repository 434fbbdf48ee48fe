"""The global test of an adjustment: whether its estimated sigma0 agrees with the a-priori one (chi-squared)."""

from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from scipy import special

#: Probability that the global test rejects an adjustment whose sigmas are right.
GLOBAL_RISK: Final = 0.01
#: Estimated over a-priori sigma0. Guessed sigmas are wrong by a factor of two or five; nobody misjudges his instruments
#: by an order of magnitude, so beyond it observations do not belong to each other, and the result is no estimate.
ABSURD: Final = 10.0
#: Residuals, as part of the distance or of the field's extent, that a result may have however small its sigmas are: the
#: accuracy that the paper asks for (section 0, 1:1000 of a flight of 20 m).
TOLERABLE: Final = 1e-3


class Verdict(StrEnum):
    """What the global test says."""

    UNTESTED = "untested"  #: nothing is redundant
    AGREES = "agrees"  #: chance explains the difference
    SMALLER = "smaller"  #: the observations are more accurate than their sigmas
    LARGER = "larger"  #: they are less accurate, or some are wrong
    ABSURD = "absurd"  #: no sigmas are wrong by so much


@dataclass(frozen=True, slots=True)
class GlobalTest:
    """The test of a square sum.

    Attributes:
        ratio: estimated / a-priori sigma0.
        redundancy: degrees of freedom of the square sum.
    """

    ratio: float
    redundancy: int

    @property
    def chance(self) -> float:
        """Probability that right sigmas give a ratio at least so unlikely, on either side."""
        if self.redundancy <= 0:
            return 1.0
        square_sum = self.ratio**2 * self.redundancy
        above, below = special.chdtrc(self.redundancy, square_sum), special.chdtr(self.redundancy, square_sum)
        return min(1.0, 2.0 * float(min(above, below)))

    @property
    def limits(self) -> tuple[float, float]:
        """The ratios between which the test accepts."""
        if self.redundancy <= 0:
            return 0.0, float("inf")
        squares = (special.chdtri(self.redundancy, risk) for risk in (1.0 - GLOBAL_RISK / 2.0, GLOBAL_RISK / 2.0))
        low, high = (float(square / self.redundancy) ** 0.5 for square in squares)
        return low, high

    @property
    def verdict(self) -> Verdict:
        """The decision."""
        if self.redundancy <= 0:
            return Verdict.UNTESTED
        if not self.ratio <= ABSURD:
            return Verdict.ABSURD
        if self.chance >= GLOBAL_RISK:
            return Verdict.AGREES
        return Verdict.LARGER if self.ratio > 1.0 else Verdict.SMALLER

    @property
    def words(self) -> str:
        """The verdict as a sentence's end."""
        low, high = self.limits
        match self.verdict:
            case Verdict.UNTESTED:
                return "nothing is redundant, so nothing is tested"
            case Verdict.AGREES:
                return (
                    f"the observations agree with their sigmas (by chance {low:.2f} to {high:.2f} times the a priori)"
                )
            case Verdict.SMALLER:
                times = 1.0 / max(self.ratio, 1e-12)
                return (
                    f"the observations are {times:.2f} times more accurate than their sigmas say, which is not chance"
                )
            case Verdict.LARGER:
                return (
                    f"the observations are {self.ratio:.2f} times less accurate than their sigmas say, which is not "
                    f"chance (up to {high:.2f}); check sigmas, interior orientations and the largest residuals"
                )
            case _:
                return (
                    f"{self.ratio:.3g} times the a priori one, neither by chance (up to {high:.2f}) nor by misjudged "
                    "sigmas; names, units or interior orientations are wrong: correct them, do not use this result"
                )
