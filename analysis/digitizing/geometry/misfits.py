"""Which rays and image lines of an operator fit worst, over all pulses."""

from collections.abc import Callable, Iterator, Sequence
from threading import Lock
from typing import Final

import numpy as np

from analysis.digitizing.geometry.pulse_marks import PulseMarks
from analysis.digitizing.geometry.space import intersected
from analysis.digitizing.marks.session import Session
from analysis.digitizing.marks.things import LINES
from analysis.measurements.model import SIDES, Measurements
from analysis.pulses.least_squares import Adjusted, adjust
from analysis.pulses.skis import skis_of
from analysis.scene.camera_system import CameraSystem
from rig.api.digitizing import Worst

#: So many of the worst are told, and only those with a larger test value than this.
_TOLD: Final = 20
_NOTABLE_W: Final = 2.0


class Misfits:
    """Test values of one operator's session. Any thread may call any method.

    Those of a pulse are computed again when something was changed there, or when cameras or the automatic measurement
    are others.

    Args:
        session: of the operator.
    """

    def __init__(self, session: Session) -> None:
        self._session = session
        self._basis: tuple[CameraSystem, Measurements | None] | None = None
        self._revision = 0
        self._known: dict[int, list[Worst]] = {}
        self._lock = Lock()

    def worst(
        self, system: CameraSystem, automatic: Measurements | None, marks: Callable[[list[int]], list[PulseMarks]]
    ) -> list[Worst]:
        """Those that fit worst, the worst one first.

        Args:
            system: the oriented cameras.
            automatic: the automatic measurement; None: there is none.
            marks: gives what is known of pulses, without those that the log does not have.
        """
        with self._lock:
            if self._basis != (system, automatic):
                self._basis, self._known = (system, automatic), {}
            revision, touched = self._session.changes(self._revision, 0.0)
            for each in touched:
                self._known.pop(each.pulse, None)
            self._revision = revision
            missing = [pulse for pulse in self._session.pulses() if pulse not in self._known]
            self._known.update({pulse: [] for pulse in missing})
            for test in _tests(system, marks(missing)):
                self._known[test.pulse].append(test)
            found = [test for of_pulse in self._known.values() for test in of_pulse]
        return sorted(found, key=lambda test: -test.w)[:_TOLD]


def _tests(system: CameraSystem, marks: Sequence[PulseMarks]) -> Iterator[Worst]:
    """Notable test values of the points and skis of pulses, all computed at once."""
    if not marks:
        return
    rays = {(now.pulse, thing): of for now in marks for thing, of in now.rays().items()}
    found = intersected(system, {f"{pulse} {thing}": of for (pulse, thing), of in rays.items()})
    yield from _notable(system, found.adjusted, list(rays))
    skis = skis_of(system, [now.effective() for now in marks])
    names = {side: name for name, side in LINES.items()}
    keys = [(now.pulse, names[side]) for now in marks for side in SIDES]
    yield from _notable(system, adjust(skis, system.covariance), keys)


def _notable(system: CameraSystem, adjusted: Adjusted, keys: Sequence[tuple[int, str]]) -> Iterator[Worst]:
    for row in np.flatnonzero(adjusted.ok).tolist():
        pulse, thing = keys[row]
        for camera, w in zip(system.names, adjusted.w[row], strict=True):
            if w > _NOTABLE_W:
                yield Worst(pulse=pulse, camera=camera, thing=thing, w=float(w))
