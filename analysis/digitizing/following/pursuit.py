"""What is needed to follow things through the images of a log, what was found, and how far that is."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

from analysis.digitizing.following.points.tracks import Automatic
from analysis.digitizing.marks.journal import Entered, Key
from analysis.digitizing.opened_log import OpenedLog
from analysis.measurements.model import ImageMeasurements, Measurements, PointMeasurement
from analysis.scene.camera_system import CameraSystem
from rig.api.digitizing import MarkSource, MarkState, TrackOrder
from rig.arrays import Floats
from rig.phrase import Phrase


@dataclass(frozen=True, eq=False)
class Pursuit:
    """What to follow, from what is known.

    Attributes:
        log: the log.
        system: the oriented cameras; None: there are none.
        marks: of the operator.
        measured: automatically; None: nothing.
        order: what, from where, and how far.
        step: called at every pulse of every thing that is followed.
    """

    log: OpenedLog
    system: CameraSystem | None
    marks: list[tuple[Key, Entered]]
    measured: Measurements | None
    order: TrackOrder
    step: Callable[[], None]

    @property
    def here(self) -> dict[Key, Entered]:
        """The marks that stand at the pulse of the order."""
        return {key: entered for key, entered in self.marks if key.pulse == self.order.pulse}

    def automatic(self, thing: str) -> Automatic:
        """Gives where the automatic measurement has a thing at a pulse, by camera."""

        def at(pulse: int) -> Mapping[str, PointMeasurement]:
            images = self._images.get(pulse, {})
            return {camera: image.points[thing] for camera, image in images.items() if thing in image.points}

        return at

    @cached_property
    def _images(self) -> dict[int, Mapping[str, ImageMeasurements]]:
        jumps = () if self.measured is None else self.measured.jumps
        return {int(pulse.pulse): pulse.images for jump in jumps for pulse in jump.pulses}


@dataclass(slots=True)
class Found:
    """What was followed so far, and why each thing ended."""

    marks: dict[Key, Entered] = field(default_factory=dict)
    stopped: dict[str, Phrase] = field(default_factory=dict)

    def add(self, key: Key, xy: Floats, sigma: Floats, source: MarkSource = MarkSource.TRACKED) -> None:
        """A place that was found, px, with its standard deviations (2,)."""
        place = (round(float(xy[0]), 4), round(float(xy[1]), 4))
        scatter = (float(sigma[0]), float(sigma[1]))
        self.marks[key] = Entered(MarkState.MEASURED, place, scatter, source)
