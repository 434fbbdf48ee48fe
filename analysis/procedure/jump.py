"""Computes one jump from what was measured in its images: raw solution, model over time, verdict."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from analysis.measurements.model import JumpMeasurements, Measurements
from analysis.motion.smoother import Motion, smooth
from analysis.procedure.contradictions import with_contradictions
from analysis.procedure.fates import fates_of
from analysis.procedure.names import only_told, told_names, untold_line, untold_parts
from analysis.procedure.verdict import judge
from analysis.pulses.solution import RawJump, solve_pulses
from analysis.result.fates import PartFate
from analysis.result.model import CameraMove, CameraOffset, Jump, PulseState, Quantity, TakeOff, phase_at
from analysis.scene.camera_system import CameraSystem
from rig.clocks import NS_PER_S, UtcNs


@dataclass(frozen=True, slots=True, eq=False)
class ComputedJump:
    """A jump with what belongs to its recording as a whole.

    Attributes:
        jump: the measured jump.
        synchrony: how much later than the others each camera shows the jumper.
        perpendicular: velocity perpendicular to the table at the take-off, m/s; None where it is not known.
    """

    jump: Jump
    synchrony: Mapping[str, CameraOffset]
    perpendicular: Quantity | None


def compute_jump(
    jump: JumpMeasurements, measurements: Measurements, system: CameraSystem, moved: Sequence[CameraMove] = ()
) -> ComputedJump:
    """Compute a jump; it is given without those points of which its measurements do not tell which marker they are.

    Args:
        jump: what was measured.
        measurements: the recording that it belongs to.
        system: the cameras as they stood during the jump.
        moved: cameras that moved and whose pose was not corrected for it, for the verdict.
    """
    everything, uncertain = jump, frozenset[str]()
    motion = smooth(jump, measurements, system)
    first = raw = solve_pulses(jump, measurements, system, motion.states, motion.removed, motion.late)
    troubles = [] if motion.message is None else [motion.message]
    told = told_names(raw.states)
    if (untold := untold_line(raw.states, told)) is not None:
        jump, uncertain = only_told(jump, told), untold_parts(told)
        motion = smooth(jump, measurements, system)
        raw = solve_pulses(jump, measurements, system, motion.states, motion.removed, motion.late)
        troubles = [untold] if not told or motion.message is None else [untold, motion.message]
    conditions = [
        {what: (before if what in uncertain else now)[what] for what in now}
        for before, now in zip(first.conditions, raw.conditions, strict=True)
    ]
    fates = fates_of(everything, raw.states, conditions, motion, system)
    pulses = with_contradictions(_pulse_states(jump, measurements, raw, motion, fates))
    frames = [pulse.images.keys() for pulse in jump.pulses]
    verdict = judge(
        pulses,
        frames,
        system,
        motion.takeoff,
        raw.tests,
        motion.offsets,
        moved,
        troubles,
        motion.scale,
        measurements.cameras,
    )
    return ComputedJump(
        Jump(jump.number, motion.takeoff, verdict, pulses, raw.tests),
        motion.offsets,
        None if motion.table is None else motion.table.perpendicular,
    )


def _pulse_states(
    jump: JumpMeasurements,
    measurements: Measurements,
    raw: RawJump,
    motion: Motion,
    fates: Sequence[Mapping[str, PartFate]],
) -> tuple[PulseState, ...]:
    return tuple(
        PulseState(
            pulse.pulse,
            UtcNs(pulse.time + round(measurements.middle_s * NS_PER_S)),
            since := _since_takeoff(pulse.pulse, motion.takeoff, jump, measurements.rate_hz),
            phase_at(since),
            state,
            smoothed,
            of_pulse,
        )
        for pulse, state, smoothed, of_pulse in zip(jump.pulses, raw.states, motion.states, fates, strict=True)
    )


def _since_takeoff(pulse: int, takeoff: TakeOff | None, jump: JumpMeasurements, rate_hz: float) -> float:
    """Seconds; without a take-off since the first pulse of the jump."""
    zero = jump.pulses[0].pulse if takeoff is None else takeoff.pulse
    return (pulse - zero) / rate_hz
