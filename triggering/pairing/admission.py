"""Accepts the frames of all cameras, refuses them, or lets them wait until their trigger times can be judged."""

from collections.abc import Iterator, Sequence
from typing import Final

from rig.clocks import HostNs
from rig.frame import FrameRecord
from triggering.pairing.camera.arrivals import LASTING
from triggering.pairing.camera.plausibility import Verdict
from triggering.pairing.camera.track import CameraTrack
from triggering.pairing.held import HeldFrames
from triggering.pairing.known_pulses import KnownPulses
from triggering.pairing.other_cameras import OtherCameras
from triggering.timeline.pulse_train import PulseTrain

#: So many cameras at least have to show a change for it to be one of the link or the computer.
_CAMERAS_LEAST: Final = 2


class Admission:
    """Judges the frames of each camera, in their order.

    The methods that end a wait are generators: they yield each accepted frame, and go on when its pulse was noted by
    `HeldFrames.release`, since the next frame is judged by it.

    Args:
        tracks: the cameras.
        pulses: open and decided pulses.
        held: the frames that wait.
        train: the rhythm of the pulses.
    """

    def __init__(self, tracks: Sequence[CameraTrack], pulses: KnownPulses, held: HeldFrames, train: PulseTrain) -> None:
        self._tracks, self._held, self._train = tracks, held, train
        self._others = [OtherCameras(camera, tracks, pulses, held, train) for camera in range(len(tracks))]

    def admits(self, camera: int, record: FrameRecord, time: HostNs) -> bool:
        """Whether a frame that has just come, triggered at `time`, is accepted at once."""
        track = self._tracks[camera]
        track.times.arrivals.heard(record.host_time, record.host_time - time)
        if len(self._tracks) == 1 or not track.times.plausibility.warm:
            return True
        if track.times.plausibility.doubted:
            self._believe_common_delay()
        if self._held.any_of(camera):
            return False
        return track.judge_new(record, time, self._others[camera]) is Verdict.ACCEPTED

    def settle(self, now: HostNs) -> Iterator[tuple[int, FrameRecord]]:
        """Accept or refuse the frames that wait, as far as the evidence goes at host time `now`: cameras and frames."""
        for camera in range(len(self._tracks)):
            for record in self._settle(camera):
                yield camera, record
        while ended := self._held.ended(now):
            for camera in ended:
                for record in self._settle_first(camera):
                    yield camera, record

    def end_epoch(self, camera: int) -> Iterator[FrameRecord]:
        """Accept or refuse all frames of a camera that wait: no more evidence will come."""
        self._note_damage_behind(camera)
        while self._held.any_of(camera):
            yield from self._settle_first(camera)

    def refuse_all(self, camera: int) -> None:
        """Refuse all frames of a camera that wait: its clock was set."""
        self._note_damage_behind(camera)
        for record in self._held.frames(camera):
            self._refuse(camera, record)

    def _believe_common_delay(self) -> None:
        """Learn all latencies anew if they have changed alike in all cameras: the link or the computer has changed.

        Times that slip do so in one camera, and not in all of them at once. Clocks may be set at once, and so they have
        to be read first.
        """
        there = [track.times for track in self._tracks if track.delivers and not track.silent]
        changes = [change for times in there if (change := times.latency_change_ns) is not None]
        since = [times.plausibility.doubted for times in there]
        period = self._train.period_ns
        at_once = len(changes) == len(there) >= _CAMERAS_LEAST and min(since) > 0 and max(since) - min(since) <= LASTING
        if at_once and min(map(abs, changes)) > period / 2 and max(changes) - min(changes) < period / 4:
            for times in there:
                times.learn_latencies_anew()

    def _settle(self, camera: int) -> Iterator[FrameRecord]:
        """Accept or refuse the frames of a camera that wait, as far as the evidence goes."""
        track, others = self._tracks[camera], self._others[camera]
        while waiting := self._held.frames(camera):
            verdict = track.judge(waiting, others)
            if verdict is Verdict.REJECTED and track.times.forget_old_readings():
                verdict = track.judge(waiting, others)
            if verdict is Verdict.WAITS:
                return
            if verdict is Verdict.ACCEPTED:
                yield from self._accept(camera, waiting[0])
            else:
                track.doubt()
                self._refuse(camera, waiting[0])

    def _settle_first(self, camera: int) -> Iterator[FrameRecord]:
        """Accept or refuse the first waiting frame of a camera, whose time to wait is over."""
        waiting = self._held.frames(camera)
        if waiting:
            track = self._tracks[camera]
            verdict = track.judge(waiting, self._others[camera], final=True)
            if verdict is Verdict.ACCEPTED:
                yield from self._accept(camera, waiting[0])
            else:
                if verdict is Verdict.REJECTED:
                    track.doubt()
                self._refuse(camera, waiting[0])
        yield from self._settle(camera)

    def _accept(self, camera: int, record: FrameRecord) -> Iterator[FrameRecord]:
        """Accept the first frame of a camera that waits."""
        self._held.take(camera)
        yield record
        self._note_damage_behind(camera)

    def _refuse(self, camera: int, record: FrameRecord) -> None:
        """Refuse the first frame of a camera that waits."""
        self._held.take(camera)
        self._tracks[camera].refuse(record)
        self._held.release(camera, record, None)
        self._note_damage_behind(camera)

    def _note_damage_behind(self, camera: int) -> None:
        """Enter the damaged arrivals behind a frame that no longer waits."""
        track = self._tracks[camera]
        while (behind := self._held.take_damaged(camera)) is not None:
            track.note_damage(behind)
