"""Computes a jump that is over: identified once more as a whole, then raw, smoothed and judged as in `svev analyze`."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from analysis.cameras.oriented_scene import OrientedScene, orientation_result
from analysis.candidates.model import PulseCandidates, SecondLook
from analysis.identification.identify import find_sightings
from analysis.measurements.model import JumpMeasurements, MeasuredCamera, Measurements, PulseMeasurements
from analysis.procedure.jump import compute_jump
from analysis.procedure.jump_search import without_gaps
from analysis.procedure.plumb import check_up
from analysis.result.model import Jump, MeasuredRecording
from analysis.worker.findings import MeasuredJump, summary
from rig.api.jump import LastJump
from rig.phrase import phrase


@dataclass(frozen=True, slots=True, eq=False)
class JumpTask:
    """A jump to be computed; everything that is needed for it, so that another thread can do it.

    Attributes:
        recording: id of the recording.
        number: of the jump in it.
        rate_hz: pulses per second.
        cameras: image size and exposure time by name.
        candidates: of the pulses in which the jumper may be in sight, where cameras at rest would show them.
        scene: cameras and balls.
        look: looks again where a marker is expected, at such places.
    """

    recording: str
    number: int
    rate_hz: float
    cameras: Mapping[str, MeasuredCamera]
    candidates: tuple[PulseCandidates, ...]
    scene: OrientedScene
    look: SecondLook

    def computed(self) -> MeasuredJump | None:
        """The jump; None if nobody jumps in the candidates.

        Raises:
            BadInputError: the Z axis of the survey does not point up.
        """
        exposures = {name: camera.exposure_s for name, camera in self.cameras.items()}
        sightings = find_sightings(self.candidates, self.scene.system, self.rate_hz, exposures)
        check_up(self.scene.system, [sighting.flight for sighting in sightings])
        longest = max((sighting.measured(self.look) for sighting in sightings), key=len, default=())
        return self.computed_of(longest) if longest else None

    def computed_of(self, pulses: Sequence[PulseMeasurements]) -> MeasuredJump:
        """The jump out of what was measured of it."""
        # Another worker of the same replay has pulses that this one has not; a slow one misses some.
        jump = JumpMeasurements(self.number, without_gaps(tuple(pulses)))
        measurements = Measurements(self.recording, self.rate_hz, self.cameras, (jump,))
        computed = compute_jump(jump, measurements, self.scene.system)
        computed = replace(computed, jump=_with_missing(computed.jump, len(jump.pulses) - len(pulses)))
        orientation = orientation_result(self.scene)
        result = MeasuredRecording(self.recording, {}, self.rate_hz, orientation, computed.synchrony, (computed.jump,))
        told = summary(self.recording, self.rate_hz, computed.jump, computed.perpendicular)
        return MeasuredJump(result, _as_live(told, len(pulses), len(jump.pulses)))


def _as_live(told: LastJump, seen: int, pulses: int) -> LastJump:
    """The figures of a jump of whose pulses so many were seen: what they are worth, the log alone tells."""
    live = phrase("jump_live", "measured live, in {seen} of its {pulses} pulses", seen=seen, pulses=pulses)
    waits = phrase("jump_live_waits", "what was measured well, the log tells")
    verdict = f"{live}; {waits if told.ok else told.verdict}"
    said = (live, waits) if told.ok else (live, *told.said)
    return told.model_copy(update={"live": True, "ok": False, "verdict": verdict, "said": said})


def _with_missing(jump: Jump, missing: int) -> Jump:
    """The jump; its verdict says how many of its pulses did not come."""
    if not missing:
        return jump
    text = "{missing} of its {pulses} pulses did not come to this worker: analyze the log"
    said, verdict = phrase("jump_incomplete", text, missing=missing, pulses=len(jump.pulses)), jump.verdict
    return replace(jump, verdict=replace(verdict, message=f"{verdict.message}; {said}", said=(*verdict.said, said)))
