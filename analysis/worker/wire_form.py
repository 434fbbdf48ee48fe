"""Puts a measured state into the form in which it travels to log and subscribers (`rig.jumper`)."""

from analysis.result.model import JumperState, Phase, PointState, Quantity, SkiState
from rig import jumper
from rig.arrays import Floats
from rig.clocks import UtcNs
from rig.pulse import PulseNumber


def wire_form(
    state: JumperState,
    *,
    recording: str,
    jump: int,
    pulse: PulseNumber,
    time: UtcNs,
    since_takeoff_s: float | None = None,
    phase: Phase | None = None,
) -> jumper.JumperState:
    """A state with what identifies it.

    Args:
        state: of the jumper.
        recording: id of the recording.
        jump: number of the jump in it.
        pulse: number of the pulse.
        time: middle of the exposure.
        since_takeoff_s: None while the take-off is not known.
        phase: likewise.
    """
    return jumper.JumperState(
        recording=recording,
        jump=jump,
        pulse=pulse,
        time=time,
        since_takeoff_s=since_takeoff_s,
        phase=None if phase is None else phase.value,
        points={name: None if point is None else _point(point) for name, point in state.points.items()},
        skis={side: None if ski is None else _ski(ski) for side, ski in state.skis.items()},
        angles={name: _measured(angle) for name, angle in state.angles.items()},
        height=_measured(state.height),
        speed=_measured(state.speed),
    )


def _point(point: PointState) -> jumper.JumperPoint:
    first, second, third = (_triple(row) for row in point.covariance)
    return jumper.JumperPoint(_triple(point.xyz), (first, second, third), point.cameras, point.status.value)


def _ski(ski: SkiState) -> jumper.JumperSki:
    slope, heading = (jumper.Measured(angle.value, angle.sigma) for angle in (ski.slope, ski.heading))
    return jumper.JumperSki(_triple(ski.direction), slope, heading, ski.cameras, ski.status.value)


def _measured(quantity: Quantity | None) -> jumper.Measured | None:
    return None if quantity is None else jumper.Measured(quantity.value, quantity.sigma)


def _triple(values: Floats) -> jumper.Triple:
    x, y, z = (float(value) for value in values)
    return x, y, z
