"""Computes a jump from what an operator measured, as `svev analyze` does, into a folder beside his marks."""

import os
import shutil
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from analysis.cameras.source import Source
from analysis.measurements.model import Measurements
from analysis.procedure.analyze import analyze
from analysis.procedure.result_folder import write_folder
from analysis.result.model import MeasuredRecording, Quantity
from photogrammetry.network.diagnosis import NotConvergedError, NotSolvableError
from rig.api.digitizing import CurvePoint, HandResult
from rig.errors import SvevError

_SUFFIX: Final = ".result"


@dataclass(frozen=True, slots=True, eq=False)
class _Order:
    measurements: Measurements
    source: Source


class Computing:
    """The results of one log's operators; each is computed in a thread, one at a time. Any thread may call any method.

    Args:
        log: the log.
        folder: of the marks; a result stands in `OPERATOR.result` there, whole or absent.
    """

    def __init__(self, log: Path, folder: Path) -> None:
        self._log, self._folder = log, folder
        self._states: dict[str, HandResult] = {}
        self._lock, self._one_at_a_time = threading.Lock(), threading.Lock()

    def begin(self, operator: str, order: Callable[[], tuple[Measurements, Source]]) -> HandResult:
        """Begin to compute; if it is computing already, nothing begins.

        Args:
            operator: whose marks.
            order: gives what counts, and where the cameras come from.

        Raises:
            SvevError: of `order`.
        """
        with self._lock:
            known = self._states.get(operator)
            if known is not None and known.state == "computing":
                return known
            measurements, source = order()
            state = self._states[operator] = HandResult(state="computing")
        thread = threading.Thread(
            target=self._work, args=(operator, _Order(measurements, source)), name="computing by hand", daemon=True
        )
        thread.start()
        return state

    def result(self, operator: str) -> HandResult:
        """How far the computing is, and what it gave."""
        return self._states.get(operator, HandResult(state="none"))

    def file(self, operator: str, name: str) -> Path | None:
        """A file of a result; None: there is none of this name."""
        found = self._folder / f"{operator}{_SUFFIX}" / name
        return found if found.is_file() and found.parent.parent == self._folder else None

    def _work(self, operator: str, order: _Order) -> None:
        with self._one_at_a_time:
            try:
                state = self._computed(operator, order)
            except (SvevError, NotSolvableError, NotConvergedError) as error:
                state = HandResult(state="failed", message=str(error))
        self._states[operator] = state

    def _computed(self, operator: str, order: _Order) -> HandResult:
        analysis = analyze(self._log, order.source, by_hand=order.measurements, images=False)
        whole = self._folder / f"{operator}{_SUFFIX}"
        making = self._folder / f".{operator}{_SUFFIX}.{os.getpid()}"
        shutil.rmtree(making, ignore_errors=True)
        try:
            files = write_folder(analysis, self._log, making, progress=None)
            shutil.rmtree(whole, ignore_errors=True)
            making.rename(whole)
        finally:
            shutil.rmtree(making, ignore_errors=True)
        jumps = analysis.result.jumps
        return HandResult(
            state="done",
            verdict="; ".join(str(jump.verdict.message) for jump in jumps),
            curves=curves_of(analysis.result),
            files=tuple(sorted(file.name for file in files)),
        )


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
