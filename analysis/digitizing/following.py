"""Follows what a person marked through the pulses: points by their appearance, skis as bars in space.

What was found is kept as tracked marks by one action; what was only predicted is not kept. Marks by hand on the way
stay as they are.
"""

from collections.abc import Iterable, Mapping
from typing import Final

import numpy as np

from analysis.digitizing.desk import Desk
from analysis.digitizing.effective import sigma_of
from analysis.digitizing.journal import Entered, Key
from analysis.digitizing.ski_following import Found, follow_skis, refine_skis
from analysis.digitizing.things import LINES
from analysis.digitizing.tracking.motion import KnownMotion
from analysis.digitizing.tracking.refining import refine_disc, refine_edge
from analysis.digitizing.tracking.tracker import Tracker
from analysis.digitizing.tracking.tracks import Automatic, Mark
from analysis.measurements.model import PointMeasurement
from rig.api.digitizing import MarkSource, MarkState, Refined, RefineOrder, Tracked, TrackOrder
from rig.errors import BadInputError

_TO_CONTINUE: Final = frozenset({MarkSource.HAND, MarkSource.REFINED, MarkSource.TRACKED, MarkSource.AUTOMATIC})
_BY_HAND: Final = frozenset({MarkSource.HAND, MarkSource.REFINED})

_SAME_M_S: Final = 2.0  # standard deviation of the velocity of a ski against that of a point of the jumper's

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
        StateForbidsError: a recording runs.
        StorageError: the disk refuses; nothing was kept.
    """
    desk.require_idle()
    session = desk.session(operator)
    desk.view(operator, order.pulse)  # refuses a pulse that is none of the log
    if order.most == 0:
        return refine(desk, operator, order)
    marks = session.everything()
    points = [thing for thing in order.things if thing not in LINES]
    lines = [thing for thing in order.things if thing in LINES]
    found = Found()
    known: dict[str, KnownMotion] = {}
    starts = {thing: _marks_of(marks, thing, order.pulse) for thing in points}
    there = {thing: of for thing, of in starts.items() if of.get(order.pulse)}
    if there:
        static = {name: image.grey for name, image in desk.log.static().items()}
        nothing = desk.log.unmeasured
        late_s = {camera: nothing.late_s(camera) for camera in nothing.cameras}
        tracker = Tracker(desk.log.frames, desk.log.facts.rate_hz, desk.orienting.system, static, late_s)
        automatic = {thing: _automatic(desk, thing) for thing in there}
        tracks = tracker.track_together(there, order.pulse, order.direction, order.most, automatic)
        for thing, of in tracks.items():
            for track in of:
                for pulse, images in track.places.items():
                    for camera, place in images.items():
                        found.add(Key(pulse, camera, thing), place.xy, place.sigma)
            found.stopped[thing] = "; ".join(dict.fromkeys(track.stopped for track in of))
            for track in of:
                if track.velocity is not None:
                    known[thing] = KnownMotion(track.velocity, _SAME_M_S)
    if lines:
        follow_skis(desk, lines, marks, found, order, known)
    if not found.stopped:
        raise BadInputError(f"pulse {order.pulse}: none of these things is marked there: mark one, best in two images")
    kept = [
        (key, entered)
        for key, entered in found.marks.items()
        if (now := session.at(key.pulse).get(key)) is None or now.source is MarkSource.TRACKED
    ]
    changed = desk.put(operator, kept)
    pulses = {thing: sorted({key.pulse for key, _ in kept if key.thing == thing}) for thing in found.stopped}
    return Tracked(revision=changed.revision, tracked=pulses, stopped=found.stopped)


def refine(desk: Desk, operator: str, order: TrackOrder) -> Tracked:
    """Find marked skis more exactly at one pulse, in all images that show them; keeps what was found by one action.

    Raises:
        BadInputError: no ski is named.
        UnknownRecordingError: the log has no such pulse.
        StateForbidsError: a recording runs, or the cameras are not oriented.
        NoFitError: no oriented camera has a frame.
        StorageError: the disk refuses; nothing was kept.
    """
    lines = [thing for thing in order.things if thing in LINES]
    if not lines:
        raise BadInputError("only skis are refined in all images at once: name one, or follow for a pulse or more")
    marks, found = desk.session(operator).at(order.pulse), Found()
    refine_skis(desk, marks, order.pulse, lines, found)
    told = {(key.camera, key.thing) for key in found.marks}
    more = [key for key in marks if (key.camera, key.thing) in told and key not in found.marks]
    changed = desk.put(operator, found.marks.items(), more)
    pulses = {line: [order.pulse] if any(key.thing == line for key in found.marks) else [] for line in lines}
    return Tracked(revision=changed.revision, tracked=pulses, stopped=found.stopped)


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
