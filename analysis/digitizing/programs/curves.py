"""Curves of all quantities that follow while a person measures: from the newest marks, in the background.

A program of its own computes them, from the cameras as they are oriented now and without looking into images, so that
no click waits. Marks that change meanwhile are what it computes from next. Nothing is computed that nobody asks for.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

from analysis.digitizing.marks.journal import Entered, Key
from analysis.measurements.model import Measurements
from analysis.result.model import Jump, Quantity
from analysis.scene.camera_system import CameraSystem
from rig.api.digitizing import CurvePoint, HandCurves
from rig.background.errands import Errands
from rig.background.messages import Progress
from rig.clocks import UtcNs


@dataclass(frozen=True, slots=True, eq=False)
class CurvesOrder:
    """From what to compute.

    Attributes:
        revision: of the session that has these marks.
        automatic: what was measured automatically, with rate and cameras of the log.
        marks: of a person.
        times: when the pulses of the log fired.
        system: the oriented cameras.
    """

    revision: int
    automatic: Measurements
    marks: tuple[tuple[Key, Entered], ...]
    times: Mapping[int, UtcNs]
    system: CameraSystem


#: What curves come from, besides the log: revision of the session, automatic measurement, cameras.
Basis = tuple[int, Measurements | None, CameraSystem]


class Curves:
    """The curves of one log's operators. Any thread may call any method.

    Args:
        busy: whether a recording runs, so that the work has to stand still; None: nothing is recorded on this computer.
    """

    def __init__(self, busy: Callable[[], bool] | None) -> None:
        self._begun: dict[str, Basis] = {}
        self._errands = Errands(
            "analysis.digitizing.programs.curves_program",
            HandCurves(state="none"),
            busy,
            heard=_heard,
            done=lambda _, curves, __: curves,
            failed=lambda before, why: before.model_copy(update={"state": "failed", "problem": why}),
            yielding=True,
        )

    def of(self, operator: str, basis: Basis, order: Callable[[], CurvesOrder]) -> HandCurves:
        """The newest curves that are known; if they come from something older, new ones are computed from now on.

        Args:
            operator: whose marks.
            basis: what they should come from.
            order: gives the same with all that is needed.
        """
        before = self._errands.state(operator)
        if self._errands.works(operator) or self._begun.get(operator) == basis:
            return before

        def ordered() -> CurvesOrder:
            self._begun[operator] = basis
            return order()

        return self._errands.begin(operator, before.model_copy(update={"state": "computing"}), ordered)

    def close(self) -> None:
        """End what is being computed."""
        self._errands.close()


def curves_of(jumps: Iterable[Jump]) -> dict[str, list[CurvePoint]]:
    """All quantities of jumps over their pulses, smoothed, by name."""
    curves: dict[str, list[CurvePoint]] = {}
    for pulse in (pulse for jump in jumps for pulse in jump.pulses):
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


def _heard(curves: HandCurves, news: Progress | bool) -> HandCurves:
    return curves.model_copy(update={"paused": news}) if isinstance(news, bool) else curves
