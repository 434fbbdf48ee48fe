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
        """Whether one of them has a frame of a time, and this camera has none yet; None: none has any near it.

        Frames that wait themselves do not outvote a camera whose frame beside them is accepted: if the pulses had
        moved, it would have no frame there. Those of a doubted camera speak against nobody.
        """
        train, near, own = self._train, None, 1 << self._camera
        half, others = train.period_ns / 2, ~own
        beside: list[tuple[HostNs, int]] = []  # pulses beside the time, and the cameras that have a frame there
        decided = self._pulses.nearest_decided(time, others)
        if decided is not None and train.tolerance_ns < abs(decided[0] - time) <= half:
            near = False
            beside.append(decided)
        if train.is_decided(time):
            return near
        for pulse in self._pulses.near(time, half):
            if pulse.delivered & others:
                if abs(pulse.time - time) <= train.tolerance_ns and pulse.frames[self._camera] is None:
                    return True
                near = False
                beside.append((pulse.time, pulse.delivered))
        at = 0  # the cameras of which a frame of the time waits
        for camera, other in self._waiting():
            if abs(other - time) <= train.tolerance_ns:
                at |= 1 << camera
            elif abs(other - time) <= half and not self._tracks[camera].times.plausibility.doubted:
                near = False
        return True if at and not self._outvoted(at | own, beside) else near

    def _outvoted(self, those: int, beside: Sequence[tuple[HostNs, int]]) -> bool:
        """Whether another camera than those has a frame at a pulse for which this one has none, not even a waiting one.

        Args:
            those: one bit each.
            beside: times of pulses, and the cameras that have an accepted frame there.
        """
        track, tolerance = self._tracks[self._camera], self._train.tolerance_ns
        own = [track.times.trigger_time(record.device_time) for record in self._held.frames(self._camera)]
        return any(
            who & ~those and not who & 1 << self._camera and not any(abs(time - pulse) <= tolerance for time in own)
            for pulse, who in beside
        )

    def pulses(self, since: HostNs, until: HostNs) -> int | None:
        """How many pulses are known after one time, until another; None: that is too long ago."""
        return self._pulses.count(since, until, self._train.tolerance_ns, [time for _, time in self._waiting()])

    def _waiting(self) -> Iterator[tuple[int, HostNs]]:
        """Cameras and trigger times of their frames that wait."""
        for other, track in enumerate(self._tracks):
            if other != self._camera:
                for record in self._held.frames(other):
                    yield other, track.times.trigger_time(record.device_time)
