"""What the frames of the other cameras say: whether they were exposed at a time, and how many pulses there were."""

from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence
from operator import attrgetter
from typing import Final

from rig.clocks import HostNs
from triggering.pairing.camera_track import CameraTrack
from triggering.pairing.held import HeldFrames
from triggering.pairing.outcomes import OpenPulse
from triggering.timeline.pulse_train import PulseTrain

_TIME: Final = attrgetter("time")


class OtherCameras:
    """All cameras but one; see `belief.Others`.

    Args:
        camera: that one.
        tracks: all cameras.
        waiting: the undecided pulses in the order of time.
        decided: times of the last decided pulses.
        held: the frames that wait to be believed.
        train: the rhythm of the pulses.
    """

    def __init__(
        self,
        camera: int,
        tracks: Sequence[CameraTrack],
        waiting: Sequence[OpenPulse],
        decided: Sequence[HostNs],
        held: HeldFrames,
        train: PulseTrain,
    ) -> None:
        self._camera, self._tracks, self._open, self._decided = camera, tracks, waiting, decided
        self._held, self._train = held, train

    def coincide(self, time: HostNs) -> bool | None:
        """Whether one of them has a frame of a time, and this camera has none yet; None: none has any near it."""
        train, near = self._train, None
        if train.last is not None and time <= train.last + train.tolerance_ns:
            return None
        half, others = train.period_ns / 2, ~(1 << self._camera)
        for pulse in self._open[bisect_left(self._open, time - half, key=_TIME) :]:
            if pulse.time > time + half:
                break
            if pulse.delivered & others:
                if abs(pulse.time - time) <= train.tolerance_ns and pulse.frames[self._camera] is None:
                    return True
                near = False
        for other in self._waiting():
            if abs(other - time) <= train.tolerance_ns:
                return True
            near = False if abs(other - time) <= half else near
        return near

    def pulses(self, since: HostNs, until: HostNs) -> int | None:
        """How many pulses are known after one time, until another; None: that is too long ago."""
        if len(self._decided) > 1 and since < self._decided[0]:
            return None
        tolerance = self._train.tolerance_ns
        known = [*self._decided, *(pulse.time for pulse in self._open)]
        for time in self._waiting():
            if not any(abs(time - other) <= tolerance for other in known):
                known.append(time)
        known.sort()
        return bisect_right(known, until + tolerance) - bisect_right(known, since + tolerance)

    def _waiting(self) -> Iterator[HostNs]:
        """Trigger times of their frames that wait."""
        for other, track in enumerate(self._tracks):
            if other != self._camera:
                for record in self._held.frames(other):
                    yield track.trigger_time(record.device_time)
