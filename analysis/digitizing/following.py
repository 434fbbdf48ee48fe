"""Follows what a person marked through the pulses: points by their appearance, skis by their edges.

What was found is kept as tracked marks by one action; what was only predicted is not kept. Marks by hand on the way
stay as they are.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from scipy.special import chdtri

from analysis.digitizing.desk import Desk
from analysis.digitizing.effective import sigma_of
from analysis.digitizing.journal import Entered, Key
from analysis.digitizing.things import LINES
from analysis.digitizing.tracking.refining import refine_disc, refine_edge, refine_line
from analysis.digitizing.tracking.tracker import Tracker
from analysis.digitizing.tracking.tracks import Automatic, Mark
from analysis.measurements.model import (
    SIDES,
    ImageMeasurements,
    PointMeasurement,
    PulseMeasurements,
    SkiMeasurement,
)
from analysis.pulses.gross_errors import RISK
from analysis.pulses.least_squares import adjust
from analysis.pulses.skis import skis_of
from rig.api.digitizing import MarkSource, MarkState, Refined, RefineOrder, Tracked, TrackOrder
from rig.arrays import Floats
from rig.errors import BadInputError, NoFitError
from rig.pulse import PulseNumber

#: The binding on each ski, which goes along with it.
_BINDINGS: Final = {"right ski": "P3", "left ski": "P4"}
_TO_CONTINUE: Final = frozenset({MarkSource.HAND, MarkSource.REFINED, MarkSource.TRACKED, MarkSource.AUTOMATIC})
_BY_HAND: Final = frozenset({MarkSource.HAND, MarkSource.REFINED})

_Marks = dict[int, dict[str, Mark]]


def refined(desk: Desk, order: RefineOrder) -> Refined:
    """The place of a thing in an image near a click, by the grey values.

    Raises:
        UnknownRecordingError: the log has no such frame.
        NoFitError: there is no such thing there; the message says why.
    """
    image = desk.log.frame(order.pulse, order.camera)
    xy = np.array((order.x, order.y))
    if order.kind == "edge":
        edge = refine_edge(image, xy)
        place, sigma = edge.xy, (edge.sigma, edge.sigma)
    else:
        disc = refine_disc(image, xy, dark=order.kind == "dark disc")
        place, sigma = disc.xy, (float(disc.sigma[0]), float(disc.sigma[1]))
    return Refined(xy=(float(place[0]), float(place[1])), sigma=sigma, kind=order.kind)


def follow(desk: Desk, operator: str, order: TrackOrder) -> Tracked:
    """Follow things from a pulse at which they are marked, and keep what was found.

    Raises:
        BadInputError: none of the things is marked there, or their marks contradict each other.
        UnknownRecordingError: the log has no such pulse.
        StorageError: the disk refuses; nothing was kept.
    """
    session = desk.session(operator)
    desk.view(operator, order.pulse)  # refuses a pulse that is none of the log
    marks = session.everything()
    points = [thing for thing in order.things if thing not in LINES]
    lines = [thing for thing in order.things if thing in LINES]
    found = _Found()
    starts = {thing: _marks_of(marks, thing, order.pulse) for thing in points}
    there = {thing: of for thing, of in starts.items() if of.get(order.pulse)}
    if there:
        static = {name: image.grey for name, image in desk.log.static().items()}
        tracker = Tracker(desk.log.frames, desk.log.facts.rate_hz, desk.orienting.system, static, _late(desk))
        automatic = {thing: _automatic(desk, thing) for thing in there}
        tracks = tracker.track_together(there, order.pulse, order.direction, order.most, automatic)
        for thing, of in tracks.items():
            for track in of:
                for pulse, images in track.places.items():
                    for camera, place in images.items():
                        found.add(Key(pulse, camera, thing), place.xy, place.sigma)
            found.stopped[thing] = "; ".join(dict.fromkeys(track.stopped for track in of))
    for line in lines:
        _Line(desk, line, marks, found).follow(order)
    if not found.stopped:
        raise BadInputError(f"pulse {order.pulse}: none of these things is marked there: mark one, best in two images")
    kept = [
        (key, entered)
        for key, entered in found.marks
        if (now := session.at(key.pulse).get(key)) is None or now.source is MarkSource.TRACKED
    ]
    changed = desk.put(operator, kept)
    pulses = {thing: sorted({key.pulse for key, _ in kept if key.thing == thing}) for thing in found.stopped}
    return Tracked(revision=changed.revision, tracked=pulses, stopped=found.stopped)


@dataclass(slots=True)
class _Found:
    """What was followed so far, and why each thing ended."""

    marks: list[tuple[Key, Entered]] = field(default_factory=list)
    stopped: dict[str, str] = field(default_factory=dict)

    def add(self, key: Key, xy: Floats, sigma: Floats) -> None:
        """A place that was found."""
        place = (round(float(xy[0]), 4), round(float(xy[1]), 4))
        scatter = (float(sigma[0]), float(sigma[1]))
        self.marks.append((key, Entered(MarkState.MEASURED, place, scatter, MarkSource.TRACKED)))

    def points(self, thing: str, pulse: int) -> dict[str, Floats]:
        """Where a thing was found at a pulse, by camera."""
        return {
            key.camera: np.array(entered.xy)
            for key, entered in self.marks
            if (key.thing, key.pulse) == (thing, pulse) and entered.xy is not None
        }


class _Line:
    """Follows one ski: its vertices go along with its binding, and the image's edges say where it lies.

    Args:
        desk: of the log.
        thing: the ski.
        marks: of the operator.
        found: what was followed so far; takes what is found.
    """

    def __init__(self, desk: Desk, thing: str, marks: Iterable[tuple[Key, Entered]], found: _Found) -> None:
        self._desk, self._thing, self._found = desk, thing, found
        self._by_hand: dict[tuple[int, str], Floats] = {}
        places: dict[tuple[int, str], list[tuple[float, float]]] = {}
        self._bindings: dict[tuple[int, str], Floats] = {}
        for key, entered in marks:
            if entered.xy is None or entered.state is not MarkState.MEASURED:
                continue
            if key.thing == thing:
                places.setdefault((key.pulse, key.camera), []).append(entered.xy)
            elif key.thing == _BINDINGS[thing]:
                self._bindings[key.pulse, key.camera] = np.array(entered.xy)
        self._by_hand = {where: np.array(xy) for where, xy in places.items() if len(xy) > 1}

    def follow(self, order: TrackOrder) -> None:
        """Go from pulse to pulse until no image shows it, or its images contradict each other."""
        last = {camera: xy for (pulse, camera), xy in self._by_hand.items() if pulse == order.pulse}
        if not last:
            return
        motion = {camera: np.zeros(2) for camera in last}
        pulse = order.pulse
        for _ in range(order.most):
            before, pulse = pulse, pulse + order.direction
            images = self._desk.log.frames(pulse)
            refusals: dict[str, str] = {}
            lines: dict[str, tuple[Floats, Floats]] = {}
            for camera, vertices in last.items():
                step = self._step(camera, before, pulse, motion[camera])
                if camera not in images:
                    refusals[camera] = "no frame"
                    continue
                try:
                    line = refine_line(images[camera], vertices + step)
                except NoFitError as error:
                    refusals[camera] = str(error).partition(":")[2].partition(";")[0].strip()
                    continue
                lines[camera] = line.xy, line.sigma
            if len(lines) < min(len(last), 2):
                said = "; ".join(f"{camera}: {why}" for camera, why in refusals.items())
                self._found.stopped[self._thing] = f"pulse {pulse}: {said}"
                return
            if (contradiction := self._contradiction(pulse, lines)) is not None:
                self._found.stopped[self._thing] = contradiction
                return
            for camera, (xy, sigma) in lines.items():
                for vertex, (place, across) in enumerate(zip(xy, sigma, strict=True)):
                    self._found.add(Key(pulse, camera, self._thing, vertex), place, np.array((across, across)))
                motion[camera] = xy.mean(axis=0) - last[camera].mean(axis=0)
                last[camera] = xy
        self._found.stopped[self._thing] = f"pulse {pulse}: as far as was asked for"

    def _step(self, camera: str, before: int, now: int, motion: Floats) -> Floats:
        """How far the ski has gone in an image: as its binding did, or as it did before."""
        name = _BINDINGS[self._thing]
        places = [
            self._found.points(name, pulse).get(camera, self._bindings.get((pulse, camera))) for pulse in (before, now)
        ]
        return motion if places[0] is None or places[1] is None else places[1] - places[0]

    def _contradiction(self, pulse: int, lines: Mapping[str, tuple[Floats, Floats]]) -> str | None:
        """In words if the lines of three images do not meet in space."""
        system = self._desk.orienting.system
        if system is None or len(lines) < 3:
            return None
        side = LINES[self._thing]
        images = {
            camera: ImageMeasurements({}, {side: SkiMeasurement(xy, sigma)}) for camera, (xy, sigma) in lines.items()
        }
        measured = PulseMeasurements(PulseNumber(pulse), self._desk.log.times[pulse], images)
        adjusted = adjust(skis_of(system, [measured], np.zeros((1, len(system.names), 3))), system.covariance)
        row = SIDES.index(side)
        if not adjusted.ok[row] or adjusted.chi_square[row] < chdtri(adjusted.redundancy[row], RISK):
            return None
        worst = max(zip(system.names, adjusted.w[row], strict=True), key=lambda each: np.nan_to_num(each[1]))
        return f"pulse {pulse}: the lines of the images do not meet in space, that of {worst[0]} least"


def _marks_of(marks: Iterable[tuple[Key, Entered]], thing: str, start: int) -> _Marks:
    """The marks of a point by pulse and camera: all at the start, elsewhere those by hand."""
    found: _Marks = {}
    for key, entered in marks:
        if key.thing != thing or entered.xy is None or entered.state is not MarkState.MEASURED:
            continue
        if entered.source in (_TO_CONTINUE if key.pulse == start else _BY_HAND):
            found.setdefault(key.pulse, {})[key.camera] = Mark(np.array(entered.xy), np.array(sigma_of(entered)))
    return found


def _automatic(desk: Desk, thing: str) -> Automatic:
    def at(pulse: int) -> Mapping[str, PointMeasurement]:
        measured = desk.automatic_at(pulse)
        images = {} if measured is None else measured.images
        return {camera: image.points[thing] for camera, image in images.items() if thing in image.points}

    return at


def _late(desk: Desk) -> dict[str, float]:
    """By camera, how much later than the mean the middle of its exposure is, s."""
    halves = {name: camera.exposure_s / 2 for name, camera in desk.log.facts.cameras.items()}
    mean = sum(halves.values()) / len(halves)
    return {name: half - mean for name, half in halves.items()}
