"""The part of the seam that helps to calibrate cameras by pictures of a target."""

from pathlib import Path
from typing import Protocol

from rig.api.calibrating import Calibrating, CalibratingOrder


class CalibrationHelper(Protocol):
    """Takes pictures of a target while somebody moves it, and computes a calibration. Any thread may call any method.

    Raises (each where it applies):
        StateForbidsError: there are no pictures, or no calibration yet, or a recording runs.
        BadInputError: a camera has no calibration.
        StorageError: pictures or rig file cannot be written.
    """

    def view(self) -> Calibrating:
        """What it does and has; who asks keeps it going."""
        ...

    def begin(self, order: CalibratingOrder) -> Calibrating:
        """Look at live pictures and keep those that are wanted."""
        ...

    def end(self) -> Calibrating:
        """Look no more, or give up computing; the pictures stay."""
        ...

    def undo(self) -> Calibrating:
        """Remove the pictures that were kept last."""
        ...

    def compute(self) -> Calibrating:
        """Compute a calibration from the pictures."""
        ...

    def save(self) -> Calibrating:
        """Put the calibration into the rig file, and into all logs from now on."""
        ...

    def protocol(self) -> Path:
        """The protocol of the calibration."""
        ...
