"""The whole analysis of a recording: from its log and the survey of the balls to the measured jumps."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from analysis.cameras.frames import LogFrames
from analysis.cameras.helmet import HelmetFlight, with_helmet
from analysis.cameras.oriented_scene import OrientedScene, orientation_result
from analysis.cameras.source import Source, orient_from
from analysis.cameras.steadiness import Steadiness, watch
from analysis.candidates.finder import Finder, find_candidates
from analysis.measurements.merging import merged
from analysis.measurements.model import JumpMeasurements, Measurements
from analysis.procedure.jump import ComputedJump, compute_jump
from analysis.procedure.jump_search import find_jumps
from analysis.procedure.log_facts import LogFacts, log_facts
from analysis.result.model import CameraOffset, MeasuredRecording, Quantity
from analysis.scene.camera_system import CameraSystem
from analysis.scene.static_image import static_images
from photogrammetry.procedures.orientation import Orientation
from rig.errors import NoJumpError

#: Told with the step that is done, in words, and the share of it that is done, 0 to 1.
Progress = Callable[[str, float], None]


@dataclass(frozen=True, slots=True, eq=False)
class Analysis:
    """A measured recording with everything that its files need.

    Attributes:
        result: the measured recording.
        measurements: what was measured in the images of the jumper.
        scene: cameras and balls.
        orientation: the adjustment of the balls; None where the poses were known.
        perpendicular: by jump, velocity perpendicular to the table at the take-off, m/s.
    """

    result: MeasuredRecording
    measurements: Measurements
    scene: OrientedScene
    orientation: Orientation | None
    perpendicular: Mapping[int, Quantity]

    @property
    def system(self) -> CameraSystem:
        """The oriented cameras."""
        return self.scene.system


def analyze(
    log: Path,
    source: Source,
    *,
    by_hand: Measurements | None = None,
    images: bool = True,
    helmet: bool = False,
    progress: Progress | None = None,
) -> Analysis:
    """Measure the jumps of a recording.

    Args:
        log: the log.
        source: survey of the balls, or poses of the cameras.
        by_hand: measurements that are used beside automatic ones, or instead of them at the same place.
        images: look for the jumper in the images; otherwise `by_hand` is all there is.
        helmet: let the moving helmet tie the images beside the balls (paper, step 2, alternative 2).
        progress: told what is being done.

    Raises:
        BadInputError: the log is none, or survey or poses do not belong to it.
        NoJumpError: nobody jumps in the log.
        NotSolvableError, NotConvergedError: the balls do not determine the cameras.
    """
    tell = progress or (lambda _step, _share: None)
    facts = log_facts(log)
    tell("looking at the balls", 0.0)
    static = static_images(log)
    scene, orientation = orient_from(static, source)
    steadiness = watch(scene, LogFrames(log))
    tell("looking at the balls", 1.0)
    jumps = _jumps_in_images(facts, scene, steadiness, tell) if images else []
    measurements = Measurements(facts.recording, facts.rate_hz, facts.cameras, tuple(jumps))
    if by_hand is not None:
        measurements = merged(measurements, by_hand)
    if not measurements.jumps:
        raise NoJumpError(
            f"{log}: nobody jumps in it: no pulse shows markers that move as a jumper does; choose another recording"
        )
    flights = [_steadied(jump, steadiness) for jump in measurements.jumps]
    if helmet:
        scene, orientation = with_helmet(scene, flights, facts.cameras, facts.rate_hz)
        steadiness = steadiness.with_scene(scene)
        flights = [_steadied(jump, steadiness) for jump in measurements.jumps]
    computed: list[ComputedJump] = []
    for flight in flights:
        tell("computing", len(computed) / len(flights))
        computed.append(compute_jump(flight.measurements, measurements, flight.system))
    result = MeasuredRecording(
        facts.recording,
        facts.session,
        facts.rate_hz,
        orientation_result(scene, steadiness.moved, (*facts.messages, *steadiness.messages)),
        _synchrony(computed),
        tuple(each.jump for each in computed),
    )
    tell("computing", 1.0)
    perpendicular = {c.jump.number: c.perpendicular for c in computed if c.perpendicular is not None}
    return Analysis(result, measurements, scene, orientation, perpendicular)


def _jumps_in_images(
    facts: LogFacts, scene: OrientedScene, steadiness: Steadiness, tell: Progress
) -> list[JumpMeasurements]:
    """What the images show of the jumper."""
    finder = Finder({name: scene.static[name] for name in scene.system.names})
    candidates = find_candidates(facts.path, finder, lambda share: tell("looking for the jumper", share))
    return find_jumps(candidates, facts, scene, steadiness, finder.look_for_spots)


def _steadied(jump: JumpMeasurements, steadiness: Steadiness) -> HelmetFlight:
    """A jump as it would have been measured in frames that do not shake, and the cameras as they stood in it."""
    standing = steadiness.during([pulse.pulse for pulse in jump.pulses])
    return HelmetFlight(
        replace(jump, pulses=tuple(standing.measurements(pulse) for pulse in jump.pulses)), standing.system
    )


def _synchrony(jumps: list[ComputedJump]) -> dict[str, CameraOffset]:
    """Of each camera the offset in the jump that shows it best; an offset that is named goes before."""
    best: dict[str, CameraOffset] = {}
    for computed in jumps:
        for name, offset in computed.synchrony.items():
            known = best.get(name)
            rank = (offset.message is None, offset.sigma_ms)
            if known is None or rank < (known.message is None, known.sigma_ms):
                best[name] = offset
    return best
