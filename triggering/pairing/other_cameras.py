"""Evidence from the frames of the other cameras: were they exposed at a time, and how many pulses were there?"""

from collections.abc import Iterator, Sequence

from rig.clocks import HostNs
from triggering.pairing.camera.track import CameraTrack
from triggering.pairing.held import HeldFrames
from triggering.pairing.known_pulses import KnownPulses
from triggering.timeline.pulse_train import PulseTrain


class OtherCameras:
    """All cameras but one; see `plausibility.Others`.

    Args:
        camera: the camera that is left out.
        tracks: all cameras.
        pulses: open and decided pulses.
        held: the frames that wait.
        train: the rhythm of the pulses.
    """

    def __init__(
        self, camera: int, tracks: Sequence[CameraTrack], pulses: KnownPulses, held: HeldFrames, train: PulseTrain
    ) -> None:
        self._camera, self._tracks, self._pulses, self._held, self._train = camera, tracks, pulses, held, train

    def coincide(self, time: HostNs) -> bool | None:
        """Whether one of them has a frame of a time, and this camera has none yet; None: none has any near it."""
        train, near = self._train, None
        half, others = train.period_ns / 2, ~(1 << self._camera)
        decided = self._pulses.nearest_decided(time, others)
        if decided is not None and train.tolerance_ns < abs(decided - time) <= half:
            near = False
        if train.is_decided(time):
            return near
        for pulse in self._pulses.near(time, half):
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
        return self._pulses.count(since, until, self._train.tolerance_ns, self._waiting())

    def _waiting(self) -> Iterator[HostNs]:
        """Trigger times of their frames that wait."""
        for other, track in enumerate(self._tracks):
            if other != self._camera:
                for record in self._held.frames(other):
                    yield track.times.trigger_time(record.device_time)
