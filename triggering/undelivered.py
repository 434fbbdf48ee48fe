"""Pulses that no camera delivered, but that the cameras' ids prove.

A camera whose id says that it took more frames between two of its own than there are pulses known in between has
exposed a frame at a pulse that nobody delivered. That pulse has happened and gets its tag. In a gap of a few whole
periods the train surely ran on: there it is enough that a camera *may* have taken a frame at such a pulse.
Where the ids of all cameras go on without a hole, nothing is invented: the train paused, or no camera saw the pulse.
"""

from collections.abc import Sequence
from typing import Final

from rig.clocks import HostNs
from triggering.camera_track import CameraTrack
from triggering.gaps import Gap
from triggering.pulse_train import PulseTrain
from triggering.pulses import OpenPulse

#: A gap between pulses is longer than this many periods.
_GAP_PERIODS: Final = 1.5
#: So many frames are believed on the word of one camera; more must be borne out by a second one if there is one that
#: could tell, lest an id gone wild fill a pause.
_BELIEVED_ALONE: Final = 3
#: In a gap with room for so many pulses at most, and a whole number of periods long (to this share), the train ran on.
_SHORT_ROOM: Final = 4
_WHOLE: Final = 0.25


def undelivered_times(
    waiting: Sequence[OpenPulse], tracks: Sequence[CameraTrack], train: PulseTrain, tolerance_ns: int
) -> list[HostNs]:
    """Times of the pulses between the last decided pulse and the next one that nobody delivered.

    Args:
        waiting: the undecided pulses in the order of time; the first is about to be decided.
        tracks: the cameras.
        train: the rhythm of the pulses.
        tolerance_ns: frames this close in time are of one pulse.
    """
    if train.last is None or waiting[0].time - train.last <= _GAP_PERIODS * train.period_ns:
        return []
    start, span = train.last, waiting[0].time - train.last
    witnesses = [
        (camera, gap)
        for camera, track in enumerate(tracks)
        if (gap := _gap_across(track, start, tolerance_ns)) is not None
    ]
    if not any(gap.holes for _, gap in witnesses):
        return []
    room = max(1, train.room(span))
    if room <= _SHORT_ROOM and abs(span / train.period_ns - (room + 1)) <= _WHOLE:
        return _spaced(start, span, room, train.period_ns)
    proven = sorted(gap.taken - _room_later(waiting, camera, gap, train) for camera, gap in witnesses)
    count = proven[-1]
    if count > _BELIEVED_ALONE and len(proven) > 1:
        count = proven[-2]
    return _spaced(start, span, min(count, room), train.period_ns)


def _gap_across(track: CameraTrack, time: HostNs, tolerance_ns: int) -> Gap | None:
    """The gap of a camera that goes on after `time`, if its ids tell anything."""
    gap = track.gap_after(time)
    return gap if gap is not None and gap.anchored and gap.start <= time + tolerance_ns else None


def _room_later(waiting: Sequence[OpenPulse], camera: int, gap: Gap, train: PulseTrain) -> int:
    """How many frames of a gap the camera may have taken at the waiting pulses, known or possible.

    What cannot be placed with certainty is thus placed as late as it can be.
    """
    later, before = 0, waiting[0].time
    for pulse in waiting:
        later += train.room(pulse.time - before)
        if pulse.frames[camera] is not None:
            return later
        later, before = later + 1, pulse.time
    return later + train.room(gap.end - before)


def _spaced(start: HostNs, span: int, count: int, period_ns: float) -> list[HostNs]:
    """Times of `count` pulses after `start`: evenly over the gap, or at its beginning if the train paused in it."""
    step = span / (max(0, count) + 1)
    if abs(step - period_ns) > _WHOLE * period_ns:
        step = period_ns
    return [HostNs(start + round(step * (index + 1))) for index in range(count)]
