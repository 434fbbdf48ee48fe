"""What can be measured by hand: the points of the stick model, landmarks of the body, skis and surveyed balls."""

from collections.abc import Iterable
from typing import Final

from analysis.digitizing.marks.landmarks import Template
from analysis.measurements.model import POINTS, SIDES
from photogrammetry.jumper.centre_of_mass import LANDMARKS
from rig.api.digitizing import Thing

BALL: Final = "ball:"
LANDMARK: Final = "mark:"
LINES: Final = {f"{side} ski": side for side in SIDES}
_TITLES: Final = {"P1": "Helmet", "P2": "Hip", "P3": "Right binding", "P4": "Left binding"}


def is_line(thing: str) -> bool:
    """Whether a thing is measured by two or more points along it."""
    return thing in LINES


def ball_of(thing: str) -> str | None:
    """The name of a surveyed ball; None if the thing is none."""
    return thing.removeprefix(BALL) if thing.startswith(BALL) else None


def things(balls: Iterable[str], templates: Iterable[Template] = ()) -> list[Thing]:
    """All things that can be measured, in the order in which they are offered.

    Args:
        balls: names of the surveyed balls.
        templates: of further landmarks.
    """
    jumper = [Thing(name=name, kind="point", title=_TITLES[name], group="jumper") for name in POINTS]
    skis = [Thing(name=name, kind="line", title=name.capitalize(), group="jumper") for name in LINES]
    marks = [
        Thing(name=LANDMARK + name, kind="point", title=name.replace("_", " ").capitalize(), group="body")
        for name in LANDMARKS
    ]
    own = [
        Thing(name=LANDMARK + point.name, kind="point", title=point.name, group=template.name, colour=point.colour)
        for template in templates
        for point in template.landmark
    ]
    surveyed = [Thing(name=BALL + name, kind="ball", title=name, group="balls") for name in balls]
    return [*jumper, *skis, *marks, *own, *surveyed]
