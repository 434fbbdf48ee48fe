"""What is known of the images of one pulse: an operator's marks beside the automatic measurement."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from analysis.digitizing.geometry.space import Ray
from analysis.digitizing.marks.effective import covariance_of, effective_pulse
from analysis.digitizing.marks.journal import Entered, Key
from analysis.digitizing.marks.things import LANDMARK
from analysis.measurements.model import PulseMeasurements
from rig.api.digitizing import MarkState
from rig.clocks import UtcNs


@dataclass(frozen=True, slots=True, eq=False)
class PulseMarks:
    """What is known of one pulse.

    Attributes:
        pulse: its number.
        time: when it fired.
        marks: of the operator.
        automatic: the automatic measurement; None: there is none.
    """

    pulse: int
    time: UtcNs
    marks: Mapping[Key, Entered]
    automatic: PulseMeasurements | None

    def effective(self) -> PulseMeasurements:
        """What counts of both."""
        return effective_pulse(self.pulse, self.time, self.marks, self.automatic)

    def says_nothing(self, camera: str, thing: str) -> bool:
        """Whether the operator says that a thing cannot be measured in an image."""
        entered = self.marks.get(Key(self.pulse, camera, thing))
        return entered is not None and entered.xy is None

    def rays(self) -> dict[str, dict[str, Ray]]:
        """The rays of all points: P1 to P4 as they count, and landmarks."""
        found: dict[str, dict[str, Ray]] = {}
        for camera, image in self.effective().images.items():
            for name, point in image.points.items():
                found.setdefault(name, {})[camera] = Ray(point.xy, point.covariance)
        for key, entered in self.marks.items():
            if key.thing.startswith(LANDMARK) and entered.state is MarkState.MEASURED and entered.xy is not None:
                found.setdefault(key.thing, {})[key.camera] = Ray(np.array(entered.xy), covariance_of(entered))
        return found

    def part(self, holds: Callable[[str], bool]) -> "MarksPart":
        """The marks of those things for which `holds` is true; equal to another one if they are the same."""
        marks = tuple(sorted((key, entered) for key, entered in self.marks.items() if holds(key.thing)))
        return MarksPart(self.pulse, self.time, marks, self.automatic)


@dataclass(frozen=True, slots=True)
class MarksPart:
    """Some of the marks of a pulse, as a key to what was computed from them."""

    pulse: int
    time: UtcNs
    marks: tuple[tuple[Key, Entered], ...]
    automatic: PulseMeasurements | None

    def whole(self) -> PulseMarks:
        """The same as something to compute from."""
        return PulseMarks(self.pulse, self.time, dict(self.marks), self.automatic)
