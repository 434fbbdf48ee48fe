"""Measures jumps from a stream of triplets: orients the cameras, follows the jumper, computes each jump at its end.

The static images come from the stream itself: triplets wait in memory until enough of them are there. From then on the
candidates of each triplet are found as it comes, and every few pulses the jumper is identified in those of the last
seconds. What is measured is told at once; when nobody has been seen for a moment, the jump is over and is computed as
a whole.
"""

from collections import deque
from collections.abc import Mapping
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from analysis.cameras.oriented_scene import OrientedScene, orientation_result
from analysis.cameras.source import orient_from, read_source
from analysis.candidates.finder import Finder
from analysis.candidates.model import PulseCandidates
from analysis.export.scene_update import scene_update
from analysis.identification.identify import identify
from analysis.measurements.model import JumpMeasurements, MeasuredCamera, Measurements
from analysis.procedure.jump import compute_jump
from analysis.pulses.solution import solve_pulses
from analysis.result.model import MeasuredRecording
from analysis.scene.static_image import StaticImage, static_image
from analysis.worker.findings import Findings, MeasuredJump, summary_of
from analysis.worker.stream import Received
from analysis.worker.wire_form import wire_form
from photogrammetry.network.diagnosis import NotConvergedError, NotSolvableError
from rig.clocks import NS_PER_S, UtcNs
from rig.errors import BadInputError
from rig.events import Level
from rig.frame import FrameStatus
from rig.pulse import PulseNumber
from rig.tag import TripletTag

#: Frames of each camera for its static image, and the time over which they are spread.
_FRAMES: Final = 25
_SPREAD_S: Final = 4.0
#: Triplets that wait until the cameras are oriented take so much memory at most.
_WAITING_BYTES: Final = 400 << 20
#: Candidates of so long a time are kept: longer than anybody is in sight.
_KEPT_S: Final = 8.0
#: How often the jumper is looked for, and after how long a time without him the jump is over.
_LOOK_S: Final = 0.4
_OVER_S: Final = 0.7
#: A stream in which nothing has come for so long has ended, or pauses.
_QUIET_S: Final = 2.0
#: After a failure to orient the cameras it is tried again with new frames after so long a time.
_AGAIN_S: Final = 10.0


class LiveAnalysis:
    """Measures what a stream shows.

    Args:
        survey: survey of the balls, or None.
        calibration: poses of the cameras, or None.
        findings: is told what is found.
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
        self._recording: _Recording | None = None
        self._said: tuple[str, ...] = ()
        self.jumps = self.pulses = self.missed = 0

    def take(self, received: Received) -> None:
        """Take the next triplet; those of one recording come in the order of their pulses."""
        tag = received.tag
        if self._recording is None or self._recording.id != tag.recording:
            self.finish()
            self._recording, self._finder = _Recording(tag), None
        self.pulses += 1
        recording = self._recording
        if recording.last is not None:
            self.missed += max(0, tag.pulse - recording.last.pulse - 1)
        recording.last = tag
        image = np.zeros(tag.shape, np.uint8) if received.image is None else received.image
        if self._finder is None:
            recording.wait(tag, image)
            if recording.is_ready():
                self._orient(recording)
        else:
            self._find(recording, tag, image)

    def idle(self, quiet_s: float) -> None:
        """Nothing has come for so long: after a moment, a recording is over that has not said so.

        Args:
            quiet_s: time since the last triplet, s.
        """
        if quiet_s < _QUIET_S or self._recording is None:
            return
        if self._finder is None and self._recording.waiting:
            self._orient(self._recording)
        if self._finder is not None and self._recording.unlooked:
            self._look(self._recording, ended=True)

    def finish(self) -> None:
        """The recording, or the stream, is over: measure what has come of it."""
        recording, self._recording = self._recording, None
        if recording is None:
            return
        if self._finder is None and recording.waiting:
            self._orient(recording)
        if self._finder is not None:
            self._look(recording, ended=True)

    def _orient(self, recording: "_Recording") -> None:
        """Orient the cameras from the triplets that wait, then find candidates in these."""
        try:
            static = recording.static_images()
            self._scene, _ = orient_from(static, self._source)
        except (BadInputError, NotSolvableError, NotConvergedError) as error:
            recording.try_again()
            self._findings.message(Level.ERROR, f"the cameras are not oriented, it is tried again: {error}")
            return
        self._finder = Finder({name: static[name] for name in self._scene.system.names})
        if self._scene.messages != self._said:
            self._said = self._scene.messages
            for message in self._said:
                self._findings.message(Level.INFO, message)
        while recording.waiting:
            self._find(recording, *recording.waiting.popleft())

    def _find(self, recording: "_Recording", tag: TripletTag, image: NDArray[np.uint8]) -> None:
        if self._finder is None:
            raise RuntimeError("the cameras are oriented before candidates are found")
        recording.keep(self._finder.find(tag, image))
        if recording.unlooked >= _LOOK_S * recording.rate_hz:
            self._look(recording)

    def _look(self, recording: "_Recording", *, ended: bool = False) -> None:
        """Identify the jumper in the candidates of the last seconds; tell what is new."""
        scene = self._scene
        if scene is None or not recording.candidates:
            return
        recording.unlooked = 0
        newest = recording.candidates[-1].pulse
        exposures = {name: camera.exposure_s for name, camera in self._cameras(recording).items()}
        look = None if self._finder is None else self._finder.look_for_spots
        for jump in identify(list(recording.candidates), scene.system, recording.rate_hz, exposures, look):
            if jump.pulses[-1].pulse <= recording.done:
                continue
            self._tell_states(recording, scene, jump)
            if ended or jump.pulses[-1].pulse < newest - _OVER_S * recording.rate_hz:
                self._tell_jump(recording, scene, jump)

    def _tell_states(self, recording: "_Recording", scene: OrientedScene, jump: JumpMeasurements) -> None:
        """Tell the pulses of a jump that have not been told yet."""
        new = tuple(pulse for pulse in jump.pulses if pulse.pulse > recording.told)
        if not new:
            return
        measurements = self._measurements(recording, jump)
        part = JumpMeasurements(recording.jumps + 1, new)
        raw = solve_pulses(part, measurements, scene.system)
        for pulse, state in zip(new, raw.states, strict=True):
            time = UtcNs(pulse.time + round(measurements.middle_s * NS_PER_S))
            found = wire_form(state, recording=recording.id, jump=part.number, pulse=pulse.pulse, time=time)
            self._findings.state(found)
            self._findings.scene(recording.id, pulse.pulse, time, scene_update(scene, state, time))
        recording.told = new[-1].pulse

    def _tell_jump(self, recording: "_Recording", scene: OrientedScene, jump: JumpMeasurements) -> None:
        """Compute a jump that is over, and tell it."""
        recording.jumps += 1
        recording.done = jump.pulses[-1].pulse
        numbered = JumpMeasurements(recording.jumps, jump.pulses)
        computed = compute_jump(numbered, self._measurements(recording, numbered), scene.system)
        result = MeasuredRecording(
            recording.id, {}, recording.rate_hz, orientation_result(scene), computed.synchrony, (computed.jump,)
        )
        self.jumps += 1
        self._findings.jump(MeasuredJump(result, summary_of(recording.id, recording.rate_hz, computed)))

    def _cameras(self, recording: "_Recording") -> dict[str, MeasuredCamera]:
        rows = recording.first.shape[0]
        return {
            camera.name: MeasuredCamera(
                (camera.columns[1] - camera.columns[0], rows), self._exposures.get(camera.name, 0.0)
            )
            for camera in recording.first.cameras
        }

    def _measurements(self, recording: "_Recording", jump: JumpMeasurements) -> Measurements:
        return Measurements(recording.id, recording.rate_hz, self._cameras(recording), (jump,))


class _Recording:
    """What has come of one recording.

    Attributes:
        first: tag of its first pulse.
        last: of its latest.
        waiting: triplets that wait until the cameras are oriented.
        candidates: of the last seconds.
        unlooked: candidates that came since the jumper was looked for.
        told, done: last pulse whose state, or whose jump, was told.
        jumps: number of jumps that were told.
    """

    def __init__(self, first: TripletTag) -> None:
        self.first = first
        self.last: TripletTag | None = None
        self.waiting: deque[tuple[TripletTag, NDArray[np.uint8]]] = deque()
        self.candidates: deque[PulseCandidates] = deque()
        self.unlooked = self.jumps = 0
        self.told, self.done = PulseNumber(0), PulseNumber(0)
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

    def wait(self, tag: TripletTag, image: NDArray[np.uint8]) -> None:
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
        if self.last is not None:
            self._ready_at = self.last.time + round(_AGAIN_S * NS_PER_S)

    def static_images(self) -> dict[str, StaticImage]:
        """The static image of each camera, from frames spread over those that wait.

        Raises:
            BadInputError: no camera has a frame.
        """
        images = {}
        for place, camera in enumerate(self.first.cameras):
            frames = [
                image[:, slice(*camera.columns)]
                for tag, image in self.waiting
                if tag.cameras[place].status is FrameStatus.OK
            ]
            if frames:
                chosen = np.unique(np.linspace(0, len(frames) - 1, _FRAMES).round().astype(int))
                images[camera.name] = static_image(camera.name, [frames[i] for i in chosen])
        if not images:
            raise BadInputError("no camera has delivered a frame; see the cameras in the panel")
        return images

    def keep(self, candidates: PulseCandidates) -> None:
        """Keep the candidates of a pulse; drop those that are too old."""
        self.candidates.append(candidates)
        self.unlooked += 1
        while candidates.time - self.candidates[0].time > _KEPT_S * NS_PER_S:
            self.candidates.popleft()
