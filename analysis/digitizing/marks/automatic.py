"""What was measured automatically in a log, beside which people measure by hand; read anew when there is more."""

import threading
from pathlib import Path

from analysis.measurements.file import read_measurements
from analysis.measurements.model import Measurements, PulseMeasurements
from rig.api.digitizing import JumpSpan


class Automatic:
    """The automatic measurement of one log. Any thread may call any method.

    Args:
        folder: of its results, if there are any.
    """

    def __init__(self, folder: Path) -> None:
        self._path = folder / "measurements.json"
        self._stamp: tuple[int, int] | None = None
        self._found: Measurements | None = None
        self._by_pulse: dict[int, PulseMeasurements] = {}
        self._lock = threading.Lock()

    def all(self) -> Measurements | None:
        """All of it; None: nothing yet."""
        try:
            state = self._path.stat()
        except OSError:
            return None
        stamp = state.st_mtime_ns, state.st_ino
        with self._lock:
            if self._stamp != stamp:
                self._found = read_measurements(self._path)
                self._stamp = stamp
                self._by_pulse = {int(pulse.pulse): pulse for jump in self._found.jumps for pulse in jump.pulses}
            return self._found

    def at(self, pulse: int) -> PulseMeasurements | None:
        """What was measured at a pulse; None: nothing."""
        self.all()
        return self._by_pulse.get(pulse)

    def span(self) -> JumpSpan | None:
        """The pulses of its first jump; None: there is none."""
        found = self.all()
        if found is None or not found.jumps:
            return None
        pulses = found.jumps[0].pulses
        return JumpSpan(first=int(pulses[0].pulse), last=int(pulses[-1].pulse), takeoff=None)
