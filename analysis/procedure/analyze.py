"""The whole analysis of a recording: from its log and the survey of the balls to the measured jumps."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from analysis.cameras.frames import LogFrames
from analysis.cameras.helmet import with_helmet
from analysis.cameras.oriented_scene import OrientedScene, orientation_result
from analysis.cameras.source import Source
from analysis.cameras.standing import Standing, SteadiedJump
from analysis.cameras.steadiness import Steadiness
from analysis.candidates.finder import Finder, find_candidates
from analysis.candidates.model import PulseCandidates
from analysis.measurements.merging import merged
from analysis.measurements.model import JumpMeasurements, Measurements
from analysis.procedure.jump import ComputedJump, compute_jump
from analysis.procedure.jump_search import find_jumps
from analysis.procedure.log_facts import log_facts
from analysis.procedure.orienting import oriented
from analysis.result.model import CameraOffset, MeasuredRecording, Quantity
from analysis.scene.camera_system import CameraSystem
from analysis.scene.static_image import StaticImage, static_images
from photogrammetry.procedures.orientation import Orientation
from rig.errors import NoJumpError
from rig.phrase import Phrase, phrase

_NAMED = 6  # pulses that a message names, at most
#: Told with the step that is done, in words, and the share of it that is done, 0 to 1.
Progress = Callable[[str, float], None]
#: Bytes of pixels in front of the static scene that are kept: those of a long jump in large images.
_MEMORY: Final = 1 << 30


@dataclass(frozen=True, slots=True, eq=False)
class SeenLog:
    """What the images of a recording show, before anything is known of the cameras.

    Attributes:
        static: static image of each camera.
        finder: looks again at a place in a frame.
        candidates: of all pulses.
    """

    static: Mapping[str, StaticImage]
    finder: Finder
    candidates: list[PulseCandidates]


@dataclass(frozen=True, slots=True, eq=False)
class Analysis:
    """A measured recording with everything that its files need.

    Attributes:
        result: the measured recording.
        measurements: what was measured in the images of the jumper.
        scene: cameras and balls.
        orientation: the adjustment of the balls; None where the poses were known.
        perpendicular: by jump, velocity perpendicular to the table at the take-off, m/s.
        standings: by jump, how the cameras stood during it.
    """

    result: MeasuredRecording
    measurements: Measurements
    scene: OrientedScene
    orientation: Orientation | None
    perpendicular: Mapping[int, Quantity]
    standings: Mapping[int, Standing]

    @property
    def system(self) -> CameraSystem:
        """The oriented cameras."""
        return self.scene.system


def look(log: Path, static: Mapping[str, StaticImage], progress: Progress | None = None) -> SeenLog:
    """Look for the jumper in the images of a recording.

    Args:
        log: the log.
        static: static image of each camera; cameras without one are left out.
        progress: told what is being done.

    Raises:
        BadInputError: the log is none, or the images are not as large as the static ones.
    """
    tell = progress or _nobody
    finder = Finder(static, _MEMORY)
    return SeenLog(static, finder, find_candidates(log, finder, lambda share: tell("looking for the jumper", share)))


def analyze(
    log: Path,
    source: Source,
    *,
    by_hand: Measurements | None = None,
    images: bool = True,
    helmet: bool = False,
    seen: SeenLog | None = None,
    progress: Progress | None = None,
) -> Analysis:
    """Measure the jumps of a recording.

    Args:
        log: the log.
        source: survey of the balls, or poses of the cameras.
        by_hand: measurements that are used beside automatic ones, or instead of them at the same place.
        images: look for the jumper in the images; otherwise `by_hand` is all there is.
        helmet: let the moving helmet tie the images beside the balls (paper, step 2, alternative 2).
        seen: what `look` found in this log, for those who measure it several times; all its cameras must have balls.
        progress: told what is being done.

    Raises:
        BadInputError: the log is none, or survey or poses do not belong to it.
        NoJumpError: nobody jumps in the log.
        NotSolvableError, NotConvergedError: the balls do not determine the cameras.
    """
    tell = progress or _nobody
    facts = log_facts(log)
    tell("looking at the balls", 0.0)
    static = static_images(log) if seen is None else seen.static
    anew = None if seen is not None else lambda name, pulses: static_images(log, pulses)[name]
    found = oriented(static, source, LogFrames(log), anew)
    scene, orientation, steadiness = found.scene, found.orientation, found.steadiness
    tell("looking at the balls", 1.0)
    jumps: list[JumpMeasurements] = []
    unread: list[Phrase] = []
    if images:
        seen = seen or look(log, {name: scene.static[name] for name in scene.system.names}, tell)
        unread = unread_pulses(seen.candidates)
        tell("naming points and skis", 0.0)
        jumps = find_jumps(seen.candidates, facts, scene, steadiness, seen.finder)
        tell("naming points and skis", 1.0)
    measurements = Measurements(facts.recording, facts.rate_hz, facts.cameras, tuple(jumps))
    if by_hand is not None:
        measurements = merged(measurements, by_hand)
    if not measurements.jumps and facts.part.text:
        text = "{log}: nobody jumps in it, but {part}"
        raise NoJumpError(phrase("why_no_jump_in_part", text, log=str(log), part=facts.part))
    if not measurements.jumps:
        text = (
            "{log}: nobody jumps in it: no pulse shows markers that move as a jumper does; choose another recording, "
            "or look whether the survey is in metres with Z up and the markers stand out"
        )
        raise NoJumpError(phrase("why_no_jump", text, log=str(log)))
    standings, flights = _flights(measurements, steadiness)
    if helmet:
        scene, orientation = with_helmet(scene, flights, facts.cameras, facts.rate_hz)
        steadiness = steadiness.with_scene(scene)
        standings, flights = _flights(measurements, steadiness)
    computed: list[ComputedJump] = []
    for flight in flights:
        tell("computing", len(computed) / len(flights))
        computed.append(compute_jump(flight.measurements, measurements, flight.system))
    result = MeasuredRecording(
        facts.recording,
        facts.session,
        facts.rate_hz,
        orientation_result(scene, steadiness.moved, (*facts.messages, *unread, *steadiness.messages)),
        _synchrony(computed),
        tuple(each.jump for each in computed),
    )
    tell("computing", 1.0)
    perpendicular = {c.jump.number: c.perpendicular for c in computed if c.perpendicular is not None}
    return Analysis(result, measurements, scene, orientation, perpendicular, standings)


def unread_pulses(candidates: Sequence[PulseCandidates]) -> list[Phrase]:
    """What to say if pulses of the log are missing between others."""
    numbers = [seen.pulse for seen in candidates]
    missing = sorted(set(range(min(numbers), max(numbers) + 1)) - set(numbers)) if numbers else []
    if not missing:
        return []
    which = ", ".join(map(str, missing[:_NAMED])) + (", ..." if len(missing) > _NAMED else "")
    text = "cannot be read from the log, which is damaged: pulses {which}; svev verify says more"
    return [phrase("log_unread", text, which=which)]


def _flights(measurements: Measurements, steadiness: Steadiness) -> tuple[dict[int, Standing], list[SteadiedJump]]:
    """How the cameras stood in each jump, by its number, and the jumps as cameras at rest would show them."""
    standings = {jump.number: steadiness.during([pulse.pulse for pulse in jump.pulses]) for jump in measurements.jumps}
    return standings, [standings[jump.number].steadied(jump) for jump in measurements.jumps]


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


def _nobody(_step: str, _share: float) -> None:
    """Is told of the progress where nobody listens."""
