"""The quantities of a result over its pulses, for a page."""

from collections.abc import Mapping

from analysis.result.model import MeasuredRecording, Quantity
from rig.api.digitizing import CurvePoint


def curves_of(result: MeasuredRecording) -> dict[str, list[CurvePoint]]:
    """All quantities of a result over its pulses, smoothed, by name."""
    curves: dict[str, list[CurvePoint]] = {}
    for pulse in (pulse for jump in result.jumps for pulse in jump.pulses):
        state = pulse.smoothed
        if state is None:
            continue
        quantities: Mapping[str, Quantity | None] = {
            **state.angles, "height": state.height, "speed": state.speed, "angle_of_attack": state.angle_of_attack,
        }  # fmt: skip
        for name, quantity in quantities.items():
            if quantity is not None:
                point = CurvePoint(pulse=int(pulse.pulse), value=quantity.value, sigma=quantity.sigma)
                curves.setdefault(name, []).append(point)
    return curves
