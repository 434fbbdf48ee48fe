"""Comparisons of measured jumps in the form of the REST API."""

from datetime import datetime

from pydantic import Field

from rig.api.fields import Model


class Span(Model):
    """A span of time, from `since` until before `until`."""

    since: datetime
    until: datetime


class QuantityDifference(Model):
    """Where the means of two groups differ most in a quantity, in units of what chance makes of it."""

    quantity: str = Field(description="alpha, beta, gamma, dphi, phi, angle_of_attack, height, speed or velocity_x/y/z")
    different: bool = Field(description="more than chance makes of the greatest of all differences in 1 of 20 cases")
    since_takeoff_s: float
    difference: float = Field(description="second group minus first one, degrees, m or m/s")
    sigma: float = Field(description="standard deviation of the difference, by how jumps scatter")
    p: float = Field(description="probability that the greatest of all differences is as large by chance")
    needed: float = Field(description="size that is more than chance there")


class Comparison(Model):
    """Two groups of measured jumps of an athlete: better than chance?"""

    first: int = Field(description="jumps of the first group")
    second: int = Field(description="jumps of the second group")
    left_out: int = Field(description="jumps of the spans that cannot be compared: not measured well, or only live")
    scatter_jumps: int = Field(
        description="jumps that tell how the athlete scatters, those of other days among them; 0: two single jumps are "
        "judged by errors of measurement alone"
    )
    different: tuple[str, ...] = Field(description="quantities that differ by more than chance")
    quantities: tuple[QuantityDifference, ...]
    one_place: bool = Field(description="whether all take-offs are at one place; otherwise each jump has its own")
