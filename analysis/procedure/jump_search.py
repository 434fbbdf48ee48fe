"""Finds the jumps in the candidates of a recording whose cameras may have moved.

At first the gates are as wide as the cameras moved. For each jumper who is sighted so, the cameras are taken as they
stood meanwhile, frame by frame, and unless they stood still he is identified once more with gates as narrow as the
measurements allow.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from analysis.cameras.oriented_scene import OrientedScene
from analysis.cameras.pose_change import changed
from analysis.cameras.standing import Standing
from analysis.cameras.steadiness import Steadiness
from analysis.candidates.model import ImageCandidates, PulseCandidates, SecondLook
from analysis.identification.identify import find_sightings, identify
from analysis.measurements.model import JumpMeasurements, PulseMeasurements
from analysis.procedure.log_facts import LogFacts
from analysis.procedure.plumb import check_up
from analysis.scene.camera_system import CameraSystem
from rig.clocks import UtcNs
from rig.pulse import PulseNumber

#: Pulses around a jump in which it is looked for again, s.
_AROUND_S = 0.5


def find_jumps(
    candidates: Sequence[PulseCandidates],
    facts: LogFacts,
    scene: OrientedScene,
    steadiness: Steadiness,
    look: SecondLook,
) -> list[JumpMeasurements]:
    """The jumps of a recording, measured in the frames as they are.

    Args:
        candidates: of all pulses.
        facts: of the log.
        scene: cameras and balls.
        steadiness: how the cameras stood.
        look: looks again at a place in a frame.

    Raises:
        BadInputError: the Z axis of the survey does not point up.
    """
    exposures = {name: camera.exposure_s for name, camera in facts.cameras.items()}
    system = changed(scene.system, scene.changes)
    moves_px = {
        move.camera: float(np.radians(np.linalg.norm(move.rotation_deg)) * system[move.camera].ideal().c)
        for move in steadiness.moved
    }
    loose = [_loosened(seen, moves_px) for seen in candidates]
    found: list[tuple[PulseMeasurements, ...]] = []
    sightings = find_sightings(loose, system, facts.rate_hz, exposures)
    check_up(system, [sighting.flight for sighting in sightings])
    for sighting in sightings:
        if not (pulses := sighting.pulses()):
            continue
        around = round(_AROUND_S * facts.rate_hz)
        first, last = pulses[0] - around, pulses[-1] + around
        window = [seen for seen in candidates if first <= seen.pulse <= last]
        standing = steadiness.during([seen.pulse for seen in window])
        if not moves_px and _stood_still(standing, system):
            if measured := sighting.measured(look):
                found.append(measured)
            continue
        steady = standing.candidates(window)
        again = identify(steady, standing.system, facts.rate_hz, exposures, standing.look(look))
        best = max(again, key=lambda one: len(one.pulses), default=None)
        if best is not None:
            found.append(tuple(standing.in_frames(pulse) for pulse in best.pulses))
    jumps = [without_gaps(pulses) for pulses in one_of_each(found)]
    return [JumpMeasurements(number, pulses) for number, pulses in enumerate(jumps, start=1)]


def one_of_each(found: Sequence[Sequence[PulseMeasurements]]) -> list[list[PulseMeasurements]]:
    """Jumpers as they were found, each once, in the order of time.

    No two jumpers are in sight at once. Where one is hidden for a while, two parts of his path are sighted, and he is
    followed beyond the ends of both: what shares pulses is one jumper. Of a shared pulse the richer measurements count.
    """
    jumps: list[dict[PulseNumber, PulseMeasurements]] = []
    for pulses in sorted(found, key=lambda each: each[0].pulse):
        if not jumps or pulses[0].pulse > max(jumps[-1]):
            jumps.append({})
        for each in pulses:
            known = jumps[-1].get(each.pulse)
            if known is None or _richness(each) > _richness(known):
                jumps[-1][each.pulse] = each
    return [[jump[number] for number in sorted(jump)] for jump in jumps]


def _richness(pulse: PulseMeasurements) -> int:
    """How much was measured in the images of a pulse."""
    return sum(len(image.points) + len(image.skis) for image in pulse.images.values())


def without_gaps(pulses: Sequence[PulseMeasurements]) -> tuple[PulseMeasurements, ...]:
    """Pulses in order, with empty ones where the log is damaged: the motion goes on between, and is predicted there."""
    numbers = [pulse.pulse for pulse in pulses]
    known = {pulse.pulse: pulse for pulse in pulses}
    times_ns = np.array([pulse.time - pulses[0].time for pulse in pulses])
    return tuple(
        known.get(PulseNumber(number))
        or PulseMeasurements(
            PulseNumber(number), UtcNs(pulses[0].time + round(float(np.interp(number, numbers, times_ns)))), {}
        )
        for number in range(numbers[0], numbers[-1] + 1)
    )


def _stood_still(standing: Standing, system: CameraSystem) -> bool:
    """Whether the cameras stood in a jump as they did before: whatever changes a pose makes it more uncertain."""
    return not standing.shake and np.array_equal(standing.system.covariance, system.covariance)


def _loosened(seen: PulseCandidates, moves_px: dict[str, float]) -> PulseCandidates:
    """Candidates whose spots may be off by as much as their camera moved."""
    if not any(moves_px.get(name) for name in seen.images):
        return seen
    return replace(seen, images={name: _wider(image, moves_px.get(name, 0.0)) for name, image in seen.images.items()})


def _wider(image: ImageCandidates, by_px: float) -> ImageCandidates:
    covariance = image.spots.covariance + by_px**2 * np.eye(2)
    return replace(image, spots=replace(image.spots, covariance=covariance))
