"""Follows what a person marked through the pulses: points by their appearance, skis as bars in space.

Marks by hand on the way stay as they are; what was only predicted is not given out.
"""

from collections.abc import Iterable
from typing import Final

import numpy as np

from analysis.digitizing.following.points.motion import KnownMotion
from analysis.digitizing.following.points.tracker import Tracker
from analysis.digitizing.following.points.tracks import FAR, Mark, one_after_another
from analysis.digitizing.following.pursuit import Found, Pursuit
from analysis.digitizing.following.skis.ski_following import follow_skis, refine_skis
from analysis.digitizing.marks.effective import sigma_of
from analysis.digitizing.marks.journal import Entered, Key
from analysis.digitizing.marks.things import LINES
from rig.api.digitizing import MarkSource, MarkState, TrackOrder
from rig.errors import BadInputError
from rig.phrase import phrase

_TO_CONTINUE: Final = frozenset({MarkSource.HAND, MarkSource.REFINED, MarkSource.TRACKED, MarkSource.AUTOMATIC})
_BY_HAND: Final = frozenset({MarkSource.HAND, MarkSource.REFINED})

_SAME_M_S: Final = 2.0  # standard deviation of the velocity of a ski against that of a point of the jumper's

_Marks = dict[int, dict[str, Mark]]


def steps_of(order: TrackOrder) -> int:
    """About how many pulses of things an order goes through; skis go together, and are the most work."""
    points = sum(thing not in LINES for thing in order.things)
    return max(1, order.most * (points + (points < len(order.things))))


def require_marked(order: TrackOrder, marks: Iterable[tuple[Key, Entered]]) -> None:
    """Refuse an order of which nothing is marked where it begins.

    Raises:
        BadInputError: it is such a one; or it names no ski, and only skis are refined in all images at once.
    """
    things = set(order.things) & set(LINES) if order.most == 0 else set(order.things)
    if not things:
        raise BadInputError(
            phrase(
                "hand_only_skis",
                "only skis are refined in all images at once: name one, or follow for a pulse or more",
            )
        )
    if not any(key.pulse == order.pulse and key.thing in things and _to_continue(entered) for key, entered in marks):
        raise BadInputError(
            phrase(
                "hand_nothing_marked",
                "pulse {pulse}: none of these things is marked there: mark one, best in two images",
                pulse=order.pulse,
            )
        )


def follow(pursuit: Pursuit) -> Found:
    """Follow things from a pulse at which they are marked.

    Raises:
        BadInputError: none of the things is marked there, or their marks contradict each other.
        NoFitError: no oriented camera has a frame there.
    """
    order, found = pursuit.order, Found()
    require_marked(order, pursuit.marks)
    lines = [thing for thing in order.things if thing in LINES]
    if order.most == 0:
        refine_skis(pursuit, lines, found)
        return found
    starts = {thing: _marks_of(pursuit.marks, thing, order.pulse) for thing in order.things if thing not in LINES}
    known = _follow_points(pursuit, {thing: of for thing, of in starts.items() if of.get(order.pulse)}, found)
    if lines:
        follow_skis(pursuit, lines, found, known)
    return found


def _follow_points(pursuit: Pursuit, starts: dict[str, _Marks], found: Found) -> dict[str, KnownMotion]:
    """Follow points from their marks; what is known of their motions then."""
    known: dict[str, KnownMotion] = {}
    if not starts:
        return known
    log, order = pursuit.log, pursuit.order
    late_s = {camera: log.unmeasured.late_s(camera) for camera in log.unmeasured.cameras}
    tracker = Tracker(log.frames, log.facts.rate_hz, pursuit.system, log.backgrounds(), late_s, pursuit.step)
    automatic = {thing: pursuit.automatic(thing) for thing in starts}
    end = (log.pulses[-1] if order.direction > 0 else log.pulses[0]) + order.direction
    most = min(order.most, abs(end - order.pulse) - 1)
    far = FAR if most == order.most else phrase("hand_log_ends", "pulse {pulse}: the log ends", pulse=end)
    tracks = tracker.track_together(starts, order.pulse, order.direction, most, automatic)
    for thing, of in tracks.items():
        for track in of:
            for pulse, images in track.places.items():
                for camera, place in images.items():
                    found.add(Key(pulse, camera, thing), place.xy, place.sigma)
            if track.velocity is not None:
                known[thing] = KnownMotion(track.velocity, _SAME_M_S)
        found.stopped[thing] = one_after_another(far if track.stopped is FAR else track.stopped for track in of)
    return known


def _to_continue(entered: Entered) -> bool:
    return entered.xy is not None and entered.state is MarkState.MEASURED and entered.source in _TO_CONTINUE


def _marks_of(marks: Iterable[tuple[Key, Entered]], thing: str, start: int) -> _Marks:
    """The marks of a point by pulse and camera: all at the start, elsewhere those by hand."""
    found: _Marks = {}
    for key, entered in marks:
        if key.thing != thing or entered.xy is None or not _to_continue(entered):
            continue
        if key.pulse == start or entered.source in _BY_HAND:
            found.setdefault(key.pulse, {})[key.camera] = Mark(np.array(entered.xy), np.array(sigma_of(entered)))
    return found
