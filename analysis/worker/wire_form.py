"""Puts a state of the jumper into the form in which it travels to log and subscribers (`rig.jumper`)."""

from analysis.result.model import PointState, Quantity, SkiState, SmoothedState
from rig import jumper
from rig.arrays import Floats
from rig.clocks import UtcNs
from rig.pulse import PulseNumber


def wire_form(
    state: SmoothedState, *, recording: str, jump: int, pulse: PulseNumber, time: UtcNs
) -> jumper.JumperState:
    """A state with what identifies it; the take-off is not known yet.

    Args:
        state: of the jumper.
        recording: id of the recording.
        jump: number of the jump in it.
        pulse: number of the pulse.
        time: middle of the exposure.
    """
    return jumper.JumperState(
        recording=recording,
        jump=jump,
        pulse=pulse,
        time=time,
        points={name: None if point is None else _point(point) for name, point in state.points.items()},
        skis={side: None if ski is None else _ski(ski) for side, ski in state.skis.items()},
        angles={name: _measured(angle) for name, angle in state.angles.items()},
        height=_measured(state.height),
        speed=_measured(state.speed),
        # O lies between the bindings: without any its velocity is nobody's
        velocity=None
        if state.points["P3"] is None and state.points["P4"] is None
        else jumper.JumperVector(_triple(state.velocity.value), _rows(state.velocity.covariance)),
        angle_of_attack=_measured(state.angle_of_attack),
    )


def _point(point: PointState) -> jumper.JumperPoint:
    return jumper.JumperPoint(_triple(point.xyz), _rows(point.covariance), point.cameras, point.status.value)


def _ski(ski: SkiState) -> jumper.JumperSki:
    slope, heading = (jumper.Measured(angle.value, angle.sigma) for angle in (ski.slope, ski.heading))
    return jumper.JumperSki(_triple(ski.direction), slope, heading, ski.cameras, ski.status.value)


def _measured(quantity: Quantity | None) -> jumper.Measured | None:
    return None if quantity is None else jumper.Measured(quantity.value, quantity.sigma)


def _rows(matrix: Floats) -> tuple[jumper.Triple, jumper.Triple, jumper.Triple]:
    first, second, third = (_triple(row) for row in matrix)
    return first, second, third


def _triple(values: Floats) -> jumper.Triple:
    x, y, z = (float(value) for value in values)
    return x, y, z
