"""What the steps of the whole procedure are called by those who translate them."""

from collections.abc import Mapping
from typing import Final

from rig.api.measuring import MeasuringStep

STEPS: Final[Mapping[str, MeasuringStep]] = {
    "looking at the balls": MeasuringStep.BALLS,
    "looking for the jumper": MeasuringStep.SEARCH,
    "naming points and skis": MeasuringStep.NAMES,
    "computing": MeasuringStep.COMPUTING,
    "writing": MeasuringStep.WRITING,
}
