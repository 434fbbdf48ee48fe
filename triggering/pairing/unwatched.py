"""Finds the pulses that were due while no camera was there to see them.

The train goes on in the rhythm that it had. That holds only from its last pulse to the next one that a camera sees, and
only if it was running when the last camera left: a camera that answered, but took no frame, shows that it had paused.
"""

from collections.abc import Sequence

from rig.clocks import HostNs
from triggering.pairing.camera_track import CameraTrack
from triggering.timeline.pulse_train import PulseTrain


def unwatched_time(train: PulseTrain, tracks: Sequence[CameraTrack], following: HostNs | None) -> HostNs | None:
    """Time of the pulse after the last decided one, if no camera was there at that time; None otherwise.

    Args:
        train: the rhythm of the pulses.
        tracks: the cameras.
        following: time of the next pulse that a camera saw; None if there is none yet.
    """
    if train.last is None or any(track.watches for track in tracks):
        return None
    rhythm = train.rhythm_ns
    if rhythm is None:
        return None
    step = rhythm
    if following is not None:
        steps = round((following - train.last) / rhythm)
        if steps <= 1:
            return None
        even = (following - train.last) / steps  # a period that is slightly off adds up to nothing
        step = even if abs(even - rhythm) * steps < rhythm / 2 else rhythm
    time = HostNs(train.last + round(step))
    return time if all(track.was_away(time) for track in tracks) else None
