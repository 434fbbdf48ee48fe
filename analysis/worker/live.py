"""Measures jumps from a stream of triplets: orients the cameras, follows the jumper, computes each jump at its end.

The static images come from the stream itself: triplets wait in memory until enough of them are there. From then on the
candidates of each triplet are found as it comes, and several times a second a jumper is sought in those of the last
moments. From the moment that one is found he is followed: each pulse is looked at where the past predicts him, and his
state at it is told at once. When nobody has been seen for a moment, the jump is over and is computed as a whole, in a
thread of its own, so that the next jumper need not wait.
"""

from collections import deque
from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import AbstractContextManager
from pathlib import Path
from types import TracebackType
from typing import Final

import numpy as np

from analysis.cameras.frames import Frames, camera_images
from analysis.cameras.live_watch import LiveWatch
from analysis.cameras.oriented_scene import OrientedScene
from analysis.cameras.source import orient_from, read_source
from analysis.cameras.standing import Standing
from analysis.cameras.steadiness import standing_in
from analysis.candidates.finder import Finder
from analysis.candidates.model import PulseCandidates, SecondLook
from analysis.export.scene_update import camera_frames, scene_update
from analysis.identification.seeking import Seeker
from analysis.measurements.model import POINTS
from analysis.scene.camera_system import CameraSystem
from analysis.worker.findings import Findings, MeasuredJump
from analysis.worker.following import Followed, Follower
from analysis.worker.stream import Received
from analysis.worker.streamed import Streamed
from analysis.worker.whole_jump import JumpTask
from analysis.worker.wire_form import wire_form
from photogrammetry.network.diagnosis import NotConvergedError, NotSolvableError, RefusedError
from rig.clocks import NS_PER_S, UtcNs
from rig.errors import BadInputError
from rig.events import Level
from rig.images.picture import Grey, measurable
from rig.phrase import Phrase, phrase
from rig.pulse import PulseNumber
from rig.tag import TripletTag

#: A jumper is sought so often, in the candidates of so long a time.
_SEEK_S: Final = 0.1
_SOUGHT_S: Final = 0.5
_WATCH_S: Final = 1.0  #: from one look at the balls to the next
_BEGUN: Final = 12  #: frames of the time of the static images that tell which cameras shake
_FEWEST_CAMERAS: Final = 2  # that show something
#: A jump is over after so long a time without its jumper; what may belong to it is searched as far before and after.
_OVER_S: Final = 0.7
#: A stream in which nothing has come for so long has ended, or pauses.
_QUIET_S: Final = 2.0


class LiveAnalysis(AbstractContextManager["LiveAnalysis"]):
    """Measures what a stream shows. Leaving its context waits for what is still being computed.

    Args:
        survey: survey of the balls, or None.
        calibration: poses of the cameras, or None.
        findings: is told what is found, in the thread that calls the methods.
        exposures_s: exposure time by camera; all alike if left out.

    Raises:
        BadInputError: both or neither file is given, or it is wrong.

    Attributes:
        jumps: number of jumps that were measured.
        pulses: number of triplets that came.
        missed: pulses that are missing between those that came.
    """

    def __init__(
        self,
        survey: Path | None,
        calibration: Path | None,
        findings: Findings,
        exposures_s: Mapping[str, float] | None = None,
    ) -> None:
        self._source = read_source(survey, calibration)
        self._findings = findings
        self._exposures = dict(exposures_s or {})
        self._scene: OrientedScene | None = None
        self._finder: Finder | None = None
        self._watch: LiveWatch | None = None
        self._recording: Streamed | None = None
        self._said: tuple[Phrase, ...] = ()
        self._refused = False
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="whole jump")
        self._computing: deque[Future[MeasuredJump | None]] = deque()
        self.jumps = self.pulses = self.missed = 0

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Wait for the thread, and tell what it has computed, unless an error ends the context."""
        if kind is None:
            self.finish()
            self._collect(wait=True)
        self._thread.shutdown(cancel_futures=True)

    def take(self, received: Received) -> None:
        """Take the next triplet; those of one recording come in the order of their pulses."""
        self._collect()
        tag = received.tag
        if self._recording is None or self._recording.id != tag.recording:
            self.finish()
            self._recording, self._finder = Streamed(tag), None
        self.pulses += 1
        recording = self._recording
        if recording.last is not None:
            self.missed += max(0, tag.pulse - recording.last.pulse - 1)
        recording.last = tag
        stored = np.zeros(tag.shape, tag.pixels.dtype) if received.image is None else received.image
        image = measurable(stored, tag.pixels)
        if self._finder is None:
            recording.wait(tag, image)
            if recording.is_ready():
                self._orient(recording)
        else:
            self._measure(recording, self._finder, tag, image)

    def idle(self, quiet_s: float) -> None:
        """Nothing has come for so long: after a moment, a recording is over that has not said so.

        Args:
            quiet_s: time since the last triplet, s.
        """
        self._collect()
        if quiet_s < _QUIET_S or self._recording is None:
            return
        if self._finder is None and self._recording.waiting:
            self._orient(self._recording)
        self._end_jump(self._recording)

    def finish(self) -> None:
        """The recording, or the stream, is over: measure what has come of it."""
        recording, self._recording = self._recording, None
        if recording is None:
            return
        if self._finder is None and recording.waiting:
            self._orient(recording)
        self._end_jump(recording)

    def _orient(self, recording: Streamed) -> None:
        """Orient the cameras from the triplets that wait, then measure in these."""
        try:
            static = recording.static_images()
            scene, _ = orient_from(static, self._source)
        except (BadInputError, NotSolvableError, NotConvergedError, RefusedError) as error:
            recording.try_again()
            text = "the cameras are not oriented, it is tried again: {why}"
            self._findings.message(Level.ERROR, phrase("event_not_oriented", text, why=error.said))
            return
        self._scene, moved = standing_in(scene)
        recording.seeker = None
        self._finder, self._watch = Finder({name: static[name] for name in scene.system.names}), LiveWatch(self._scene)
        self._watch.begin(recording.waiting_frames(_BEGUN))
        self._findings.oriented(recording.id, (recording.last or recording.first).time, self._scene)
        said = (*scene.messages, *(move.said for move in moved))
        if said != self._said:
            self._said = said
            for each in said:
                self._findings.message(Level.INFO, each)
        while recording.waiting and (finder := self._finder) is not None:
            self._measure(recording, finder, *recording.waiting.popleft())

    def _measure(self, recording: Streamed, finder: Finder, tag: TripletTag, image: Grey) -> None:
        """Follow the jumper, or look whether one comes."""
        follower, frames = recording.follower, camera_images(tag, image)
        if follower is None:
            self._keep(recording, finder.find(tag, image), frames)
            self._seek(recording)
            self._look_at_balls(recording, tag.pulse, frames)
        elif follower.lost(tag.pulse, tag.time):
            recording.follower = None
            self._keep(recording, finder.find(tag, image), frames)
        else:
            self._keep(recording, finder.find_expected(tag, image, follower.expected(tag.time)), frames)
            self._tell(recording, follower.follow(recording.candidates[-1], self._look(recording)))
            recording.saw(follower)
            if follower.look_is_due():
                self._seek_hidden(recording, follower)
        if recording.follower is None and recording.unseen_s() > _OVER_S:
            self._end_jump(recording)

    def _keep(self, recording: Streamed, candidates: PulseCandidates, frames: Frames) -> None:
        """Keep the candidates of a pulse where its cameras would show them if they did not shake."""
        if self._scene is None or self._watch is None:
            raise RuntimeError("candidates are sought when the cameras are oriented and watched")
        stood = self._watch.stood(frames)
        shake = {name: {candidates.pulse: one} for name, one in stood.items()}
        recording.keep(Standing(self._scene.system, shake).candidates([candidates])[0], stood)

    def _look_at_balls(self, recording: Streamed, pulse: PulseNumber, frames: Frames) -> None:
        """Between two jumps, watch the balls in some frames a second; orient the cameras anew if one has moved."""
        due = pulse - recording.watched >= _WATCH_S * recording.rate_hz
        if self._watch is None or recording.seen is not None or not due:
            return
        if not self._watch.look(pulse, frames):
            return
        recording.watched = pulse
        if moves := self._watch.moves():
            for move in moves:
                said = phrase("event_camera_moved", "{what}; the cameras are oriented anew", what=move.said)
                self._findings.message(Level.WARNING, said)
            recording.wait_anew()
            self._finder = self._watch = None

    def _seek(self, recording: Streamed) -> None:
        """Begin to follow a jumper if one is in sight."""
        rate, newest = recording.rate_hz, recording.candidates[-1]
        if self._refused:
            return
        showing = sum(bool(len(image.spots)) for image in newest.images.values())
        if self._scene is None or showing < _FEWEST_CAMERAS or newest.pulse < recording.sought + _SEEK_S * rate:
            return
        recording.sought = newest.pulse
        follower, states = self._found_since(recording, PulseNumber(recording.told + 1), self._scene.system)
        if states:
            recording.follow(follower)
            for followed in states:
                self._tell(recording, followed)

    def _seek_hidden(self, recording: Streamed, follower: Follower) -> None:
        """Seek the jumper who is followed anew, as if he came into sight: markers may be known by now that were not."""
        if self._scene is None:
            return
        known = len(POINTS) - follower.hidden()
        again, states = self._found_since(recording, follower.first, self._scene.system, known)
        if states and again.knows_more_than(follower):
            again.continue_from(follower)
            recording.follow(again)

    def _found_since(
        self, recording: Streamed, first: PulseNumber, system: CameraSystem, more_than: int = 0
    ) -> tuple[Follower, list[Followed]]:
        """A follower of who is found in the candidates of the last moments, and his states; none if nobody is.

        Of a jumper more markers than `more_than` must be found.
        """
        rate, newest = recording.rate_hz, recording.candidates[-1].pulse
        cameras = recording.cameras(self._exposures)
        if recording.seeker is None:
            exposures = {name: camera.exposure_s for name, camera in cameras.items()}
            recording.seeker = Seeker(system, exposures)
        follower = Follower(system, cameras, rate)
        recent = recording.between(max(newest - _SOUGHT_S * rate, first), newest)
        return follower, follower.find(recording.seeker, recent, more_than, self._look(recording))

    def _tell(self, recording: Streamed, followed: Followed) -> None:
        """Tell a state."""
        if self._scene is None:
            raise RuntimeError("the cameras are oriented before anybody is followed")
        measured = recording.cameras(self._exposures)
        middle_s = sum(camera.exposure_s for camera in measured.values()) / 2 / max(1, len(measured))
        time = UtcNs(followed.time + round(middle_s * NS_PER_S))
        state = wire_form(followed.state, recording=recording.id, jump=recording.jumps, pulse=followed.pulse, time=time)
        if recording.placed != recording.jumps:
            recording.placed = recording.jumps
            self._findings.cameras(recording.id, followed.pulse, time, camera_frames(self._scene.system, time))
        self._findings.state(state)
        scene = scene_update(self._scene, followed.state, time)
        self._findings.scene(recording.id, followed.pulse, time, scene)
        recording.told = followed.pulse

    def _end_jump(self, recording: Streamed) -> None:
        """Compute the jump of the jumper who was followed last, if that is not done, in the other thread."""
        scene, finder, seen = self._scene, self._finder, recording.seen
        if scene is None or finder is None or seen is None:
            return
        recording.follower = recording.seen = None
        around = _OVER_S * recording.rate_hz
        task = JumpTask(
            recording.id,
            recording.jumps,
            recording.rate_hz,
            recording.cameras(self._exposures),
            tuple(recording.between(max(seen[0] - around, recording.done + 1), seen[1] + around)),
            scene,
            self._look(recording),
        )
        recording.done = seen[1]
        self._computing.append(self._thread.submit(task.computed))

    def _look(self, recording: Streamed) -> SecondLook:
        """Looks at the images of a recording."""
        if self._scene is None or self._finder is None:
            raise RuntimeError("the cameras are oriented before anything is looked at")
        shake = {name: dict(of) for name, of in recording.shake.items()}
        return Standing(self._scene.system, shake).look(self._finder)

    def _refuse(self, error: BadInputError) -> None:
        """Nobody is followed any more with a survey that a flight has proved wrong; that is said once."""
        if not self._refused:
            text = "no jump is measured any more: {why}; then start the analysis again"
            self._findings.message(Level.ERROR, phrase("event_survey_refused", text, why=error.said))
        self._refused = True

    def _collect(self, *, wait: bool = False) -> None:
        """Tell the jumps that are computed."""
        while self._computing and (wait or self._computing[0].done()):
            try:
                jump = self._computing.popleft().result()
            except BadInputError as error:
                self._refuse(error)
                continue
            if jump is not None:
                self.jumps += 1
                self._findings.jump(jump)
