"""What has come of a streamed recording: frames that wait, candidates of the last seconds, the jumper in sight."""

from collections import deque
from collections.abc import Mapping
from typing import Final

import numpy as np

from analysis.cameras.frames import Frames, camera_images
from analysis.cameras.standing import FrameShake
from analysis.candidates.model import PulseCandidates
from analysis.identification.seeking import Seeker
from analysis.measurements.model import MeasuredCamera
from analysis.scene.static_image import StaticImage, static_image
from analysis.worker.following import Follower
from rig.clocks import NS_PER_S
from rig.errors import BadInputError
from rig.frame import FrameStatus
from rig.images.picture import Grey
from rig.pulse import PulseNumber
from rig.tag import TripletTag

#: Frames of each camera for its static image, and the time over which they are spread.
_FRAMES: Final = 25
_SPREAD_S: Final = 4.0
#: Triplets that wait until the cameras are oriented take so much memory at most.
_WAITING_BYTES: Final = 400 << 20
#: Candidates of so long a time are kept: longer than anybody is in sight.
_KEPT_S: Final = 8.0
#: While nobody is, the last moments are enough: a jumper is found soon after he has come into sight.
_KEPT_UNSEEN_S: Final = 2.0
#: After a failure to orient the cameras it is tried again with new frames after so long a time.
_AGAIN_S: Final = 10.0


class Streamed:
    """A recording as far as it has come.

    Attributes:
        first: tag of its first pulse.
        last: of its latest.
        waiting: triplets that wait until the cameras are oriented.
        candidates: of the last seconds, where the cameras would show them if they stood still.
        shake: by camera and pulse, what was taken out of these candidates.
        seeker: seeks one in the candidates; None until the first time.
        follower: follows the jumper; None while nobody is in sight.
        seen: first and last pulse of the jumper who was followed and whose jump is not computed yet; None: nobody.
        told: last pulse whose state was told.
        done: last pulse of the last jump that was computed.
        sought: pulse at which a jumper was sought last.
        watched: pulse at which the last look at the balls ended.
        jumps: number of jumps so far, that of the jumper who is in sight among them.
        placed: the last of them for which it was told where the cameras stand.
    """

    def __init__(self, first: TripletTag) -> None:
        self.first = first
        self.last: TripletTag | None = None
        self.waiting: deque[tuple[TripletTag, Grey]] = deque()
        self.candidates: deque[PulseCandidates] = deque()
        self.shake: dict[str, dict[PulseNumber, FrameShake]] = {}
        self.seeker: Seeker | None = None
        self.follower: Follower | None = None
        self.seen: tuple[PulseNumber, PulseNumber] | None = None
        self.told, self.done = PulseNumber(0), PulseNumber(0)
        self.jumps = self.placed = 0
        self.sought = self.watched = PulseNumber(0)
        self._ready_at = first.time + round(_SPREAD_S * NS_PER_S)

    @property
    def id(self) -> str:
        """Id of the recording."""
        return self.first.recording

    @property
    def rate_hz(self) -> float:
        """Pulses per second, as far as two pulses have come."""
        last = self.last
        if last is None or last.pulse == self.first.pulse:
            return 1.0
        return float((last.pulse - self.first.pulse) * NS_PER_S / (last.time - self.first.time))

    def cameras(self, exposures_s: Mapping[str, float]) -> dict[str, MeasuredCamera]:
        """Image size and exposure time of each camera."""
        return {
            camera.name: MeasuredCamera(camera.size(self.first.shape), exposures_s.get(camera.name, 0.0))
            for camera in self.first.cameras
        }

    def wait(self, tag: TripletTag, image: Grey) -> None:
        """Keep a triplet until the cameras are oriented; the oldest make room."""
        self.waiting.append((tag, image.copy()))
        while len(self.waiting) * image.nbytes > _WAITING_BYTES:
            self.waiting.popleft()

    def is_ready(self) -> bool:
        """Whether the triplets that wait are spread over time enough for static images."""
        last = self.last
        full = len(self.waiting) * self.waiting[-1][1].nbytes > _WAITING_BYTES - self.waiting[-1][1].nbytes
        return last is not None and (last.time >= self._ready_at or (full and len(self.waiting) >= _FRAMES))

    def try_again(self) -> None:
        """Wait for other triplets."""
        self._wait_for(_AGAIN_S)

    def wait_anew(self) -> None:
        """Wait for triplets for new static images."""
        self._wait_for(_SPREAD_S)

    def _wait_for(self, seconds: float) -> None:
        if self.last is not None:
            self._ready_at = self.last.time + round(seconds * NS_PER_S)

    def static_images(self) -> dict[str, StaticImage]:
        """The static image of each camera, from frames spread over those that wait.

        Raises:
            BadInputError: no camera has a frame.
        """
        images = {}
        for place, camera in enumerate(self.first.cameras):
            frames = [image[camera.part] for tag, image in self.waiting if tag.cameras[place].status is FrameStatus.OK]
            if frames:
                chosen = np.unique(np.linspace(0, len(frames) - 1, _FRAMES).round().astype(int))
                images[camera.name] = static_image(camera.name, [frames[i] for i in chosen])
        if not images:
            raise BadInputError("no camera has delivered a frame; see the cameras in the panel")
        return images

    def waiting_frames(self, count: int) -> list[Frames]:
        """The frames of so many pulses, spread over those that wait."""
        chosen = np.unique(np.linspace(0, len(self.waiting) - 1, count).round().astype(int))
        return [camera_images(*self.waiting[i]) for i in chosen]

    def follow(self, follower: Follower) -> None:
        """Somebody is in sight: the jumper who was just lost, or the next one."""
        self.jumps += self.seen is None
        self.follower = follower
        self.seen = (follower.first if self.seen is None else self.seen[0], follower.last)

    def saw(self, follower: Follower) -> None:
        """The jumper was looked for at the latest pulse."""
        if self.seen is not None:
            self.seen = self.seen[0], follower.last

    def unseen_s(self) -> float:
        """Time since the jumper who was followed last was seen; 0 if there was none."""
        if self.seen is None or not self.candidates:
            return 0.0
        return (self.candidates[-1].pulse - self.seen[1]) / self.rate_hz

    def keep(self, candidates: PulseCandidates, stood: Mapping[str, FrameShake]) -> None:
        """Keep candidates, and how the cameras stood that shake; the oldest make room."""
        self.candidates.append(candidates)
        for name, shake in stood.items():
            self.shake.setdefault(name, {})[candidates.pulse] = shake
        kept_s = _KEPT_UNSEEN_S if self.seen is None else _KEPT_S
        while self.candidates[-1].pulse - self.candidates[0].pulse > kept_s * self.rate_hz:
            gone = self.candidates.popleft().pulse
            for shakes in self.shake.values():
                shakes.pop(gone, None)

    def between(self, first: float, last: float) -> list[PulseCandidates]:
        """The candidates of the pulses from `first` to `last`."""
        return [kept for kept in self.candidates if first <= kept.pulse <= last]
