"""Finds pulses without a frame of any camera, where the frame ids prove that they fired.

If a camera's ids say that it took more frames between two whole ones than there are known pulses in between, it exposed
a frame at an unknown pulse. That pulse fired and gets its tag. In a gap of a few whole periods of a measured rhythm the
train surely ran on: there it is enough that a camera *may* have taken a frame at such a pulse. Where the ids of all
cameras go on without a hole no pulse is added: the train paused, or no camera saw the pulse.
"""

from collections.abc import Sequence
from typing import Final

from rig.clocks import HostNs
from triggering.pairing.camera.gaps import Gap
from triggering.pairing.camera.track import CameraTrack
from triggering.pairing.outcomes import OpenPulse
from triggering.timeline.pulse_train import PulseTrain

#: An interval of more than this many periods is a gap.
_GAP_PERIODS: Final = 1.5
#: The ids of one camera alone prove this many pulses; more must be confirmed by a second camera if there is one whose
#: ids could tell, so that a wrong id does not fill a pause with pulses.
_PROVEN_ALONE: Final = 3
#: In a gap of at most this many pulses that is a whole number of periods long (to this share of one), the train ran on.
_SHORT_ROOM: Final = 4
_WHOLE: Final = 0.25


def undelivered_times(waiting: Sequence[OpenPulse], tracks: Sequence[CameraTrack], train: PulseTrain) -> list[HostNs]:
    """Times of the undelivered pulses between the last decided pulse and the next one.

    Args:
        waiting: the undecided pulses in the order of time; the first is about to be decided.
        tracks: the cameras.
        train: the rhythm of the pulses.
    """
    if train.last is None or waiting[0].time - train.last <= _GAP_PERIODS * train.period_ns:
        return []
    start, span = train.last, waiting[0].time - train.last
    witnesses = [(camera, gap) for camera, track in enumerate(tracks) if (gap := track.gap_across(start)) is not None]
    if not any(gap.holes for _, gap in witnesses):
        return []
    room = max(1, train.room(span))
    if train.rhythm.steady and room <= _SHORT_ROOM and abs(span / train.period_ns - (room + 1)) <= _WHOLE:
        return _spaced(start, span, room, train.period_ns)
    proven = sorted(gap.taken - _room_later(waiting, camera, gap, train) for camera, gap in witnesses)
    count = proven[-1]
    if count > _PROVEN_ALONE and len(proven) > 1:
        count = proven[-2]
    return _spaced(start, span, min(count, room), train.period_ns)


def _room_later(waiting: Sequence[OpenPulse], camera: int, gap: Gap, train: PulseTrain) -> int:
    """How many frames of a gap the camera may have taken at the waiting pulses, or at possible ones between them.

    A frame whose pulse is not certain is thus assigned as late as possible.
    """
    later, before = 0, waiting[0].time
    for pulse in waiting:
        later += train.room(pulse.time - before)
        if pulse.frames[camera] is not None:
            return later
        later, before = later + 1, pulse.time
    return later + train.room(gap.end - before)


def _spaced(start: HostNs, span: int, count: int, period_ns: float) -> list[HostNs]:
    """Times of `count` pulses after `start`: even over the gap, or at its beginning if the train paused in it."""
    step = span / (max(0, count) + 1)
    if abs(step - period_ns) > _WHOLE * period_ns:
        step = period_ns
    return [HostNs(start + round(step * (index + 1))) for index in range(count)]
