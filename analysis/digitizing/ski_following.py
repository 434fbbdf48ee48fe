"""Follows skis through the pulses: they go along with their bindings, and the bars in the images say where they lie."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from scipy.special import chdtri

from analysis.digitizing.desk import Desk
from analysis.digitizing.journal import Entered, Key
from analysis.digitizing.things import LINES
from analysis.digitizing.tracking.skis import SeenSki, SkiFinder
from analysis.measurements.model import SIDES, ImageMeasurements, PulseMeasurements, SkiMeasurement
from analysis.pulses.gross_errors import RISK
from analysis.pulses.least_squares import adjust
from analysis.pulses.skis import skis_of
from rig.api.digitizing import MarkSource, MarkState, TrackOrder
from rig.arrays import Floats
from rig.clocks import UtcNs
from rig.errors import NoFitError
from rig.pulse import PulseNumber

#: The binding on each ski, which goes along with it.
_BINDINGS: Final = {"right ski": "P3", "left ski": "P4"}
#: Images in which a ski must be found, if it was marked in more than one: from two follows a line in space.
_FEWEST_IMAGES: Final = 2
#: Three images control each other. Where fewer of those in which a ski was marked show it, nothing of it is kept.
_CONTROLLED: Final = 3
#: So many pulses in a row a ski may be missed before it has ended.
_MISSED: Final = 3
_FAR: Final = "it was tracked as far as was asked"

_Marks = Sequence[tuple[Key, Entered]]


@dataclass(slots=True)
class Found:
    """What was followed so far, and why each thing ended."""

    marks: list[tuple[Key, Entered]] = field(default_factory=list)
    stopped: dict[str, str] = field(default_factory=dict)

    def add(self, key: Key, xy: Floats, sigma: Floats) -> None:
        """A place that was found, px, with its standard deviations (2,)."""
        place = (round(float(xy[0]), 4), round(float(xy[1]), 4))
        scatter = (float(sigma[0]), float(sigma[1]))
        self.marks.append((key, Entered(MarkState.MEASURED, place, scatter, MarkSource.TRACKED)))


@dataclass(slots=True)
class _InImage:
    """A ski in one camera: as it was seen last, how far it has gone since, and how far it goes from pulse to pulse."""

    seen: SeenSki
    step: Floats = field(default_factory=lambda: np.zeros(2))
    pace: Floats = field(default_factory=lambda: np.zeros(2))
    missed: int = 0


def follow_skis(desk: Desk, lines: Sequence[str], marks: _Marks, found: Found, order: TrackOrder) -> None:
    """Follow skis from a pulse at which they are marked.

    Args:
        desk: of the log.
        lines: names of the skis; those that are not marked there are left out.
        marks: of the operator.
        found: points that were followed, whose bindings show the way; takes what is found.
        order: where to begin, and how far to go.
    """
    finder = SkiFinder(desk.log.static(), desk.log.facts.rate_hz)
    ways = _ways([*marks, *found.marks])
    skis: dict[str, dict[str, _InImage]] = {}
    for line in lines:
        skis[line] = _begun(desk, finder, line, marks, found, order.pulse)
    pulse = order.pulse
    for _ in range(order.most):
        before, pulse = pulse, pulse + order.direction
        open_ = {line: images for line, images in skis.items() if images and line not in found.stopped}
        if not open_:
            return
        for line, images in open_.items():
            for camera, ski in images.items():
                ski.step = ski.step + _step(ways, line, camera, before, pulse, ski.pace)
        for line, images in open_.items():
            other = next((known for name, known in open_.items() if name != line), {})
            _find(desk, finder, line, images, other, found, pulse)
    for line, images in skis.items():
        if images:
            found.stopped.setdefault(line, _FAR)


def _begun(desk: Desk, finder: SkiFinder, line: str, marks: _Marks, found: Found, pulse: int) -> dict[str, _InImage]:
    """The ski in the images in which it is marked."""
    places: dict[str, list[tuple[float, float]]] = {}
    for key, entered in marks:
        if key.thing == line and key.pulse == pulse and entered.xy is not None:
            places.setdefault(key.camera, []).append(entered.xy)
    images, begun, refusals = desk.log.frames(pulse), {}, []
    for camera, xy in places.items():
        if len(xy) > 1 and camera in images:
            try:
                begun[camera] = _InImage(finder.marked(camera, images[camera], np.array(xy)))
            except NoFitError as error:
                refusals.append(str(error))
    if len(begun) < min(len(places), _FEWEST_IMAGES):
        found.stopped[line] = "; ".join(refusals) or f"pulse {pulse}: a ski needs two points in an image"
        return {}
    return begun


def _find(
    desk: Desk, finder: SkiFinder, line: str, images: dict[str, _InImage], other: Mapping[str, _InImage], found: Found,
    pulse: int,
) -> None:  # fmt: skip
    """Find a ski in the images of a pulse; after some in which that failed, it has ended."""
    frames, now, refusals = desk.log.frames(pulse), {}, []
    for camera, ski in images.items():
        elsewhere = other.get(camera)
        try:
            now[camera] = finder.again(
                camera,
                frames[camera],
                ski.seen,
                ski.step,
                ski.missed + 1,
                None if elsewhere is None else elsewhere.seen.ends + elsewhere.step,
            )
        except KeyError:
            refusals.append(f"{camera}: there is no frame")
        except NoFitError as error:
            refusals.append(str(error))
    contradiction = _contradiction(desk, line, now)
    if len(now) < min(len(images), _CONTROLLED) or contradiction is not None:
        for ski in images.values():
            ski.missed += 1
        if max(ski.missed for ski in images.values()) > _MISSED:
            found.stopped[line] = f"pulse {pulse}: {contradiction or '; '.join(refusals)}"
        return
    for camera, seen in now.items():
        for vertex, place in enumerate(seen.xy):
            found.add(Key(pulse, camera, line, vertex), place, np.array((seen.sigma, seen.sigma)))
        last = images[camera]
        pace = (seen.ends.mean(axis=0) - last.seen.ends.mean(axis=0)) / (last.missed + 1)
        images[camera] = _InImage(seen, pace=pace)
    for camera in images.keys() - now.keys():
        images[camera].missed += 1
        if images[camera].missed > _MISSED:
            del images[camera]


def _ways(marks: _Marks) -> dict[tuple[str, str, int], Floats]:
    """Where each camera shows the bindings, by name, camera and pulse."""
    return {
        (key.thing, key.camera, key.pulse): np.array(entered.xy)
        for key, entered in marks
        if key.thing in _BINDINGS.values() and entered.xy is not None and entered.state is MarkState.MEASURED
    }


def _step(
    ways: Mapping[tuple[str, str, int], Floats], line: str, camera: str, before: int, now: int, pace: Floats
) -> Floats:
    """How far a ski has gone in an image: as its binding did, or as it did before."""
    first, last = (ways.get((_BINDINGS[line], camera, pulse)) for pulse in (before, now))
    return pace if first is None or last is None else last - first


def _contradiction(desk: Desk, line: str, skis: Mapping[str, SeenSki]) -> str | None:
    """In words if the lines of three images do not meet in space; two planes always do."""
    system = desk.orienting.system
    if system is None or len(skis) < _CONTROLLED:
        return None
    side = LINES[line]
    images = {
        camera: ImageMeasurements({}, {side: SkiMeasurement(ski.xy, np.full(2, ski.sigma))})
        for camera, ski in skis.items()
    }
    measured = PulseMeasurements(PulseNumber(1), UtcNs(0), images)  # whichever: one pulse is tested by itself
    adjusted = adjust(skis_of(system, [measured], np.zeros((1, len(system.names), 3))), system.covariance)
    row = SIDES.index(side)
    if not adjusted.ok[row] or adjusted.chi_square[row] < chdtri(adjusted.redundancy[row], RISK):
        return None
    worst = max(zip(system.names, adjusted.w[row], strict=True), key=lambda each: np.nan_to_num(each[1]))
    return f"the lines of the images do not meet in space, that of {worst[0]} least"
