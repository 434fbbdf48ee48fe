"""A calibration helper in memory: it shows what a test sets, and changes its state as the real one does."""

from pathlib import Path

from rig.api.calibrating import Calibrating, CalibratingOrder, CalibratingState
from rig.errors import StateForbidsError


class MemoryCalibrating:
    """See `service.seam.cameras.CalibrationHelper`.

    Attributes:
        shown: what `view` says.
        orders: with which it was begun.
        page: the protocol; None: there is none.
    """

    def __init__(self) -> None:
        self.shown = Calibrating(state=CalibratingState.OFF)
        self.orders: list[CalibratingOrder] = []
        self.page: Path | None = None

    def show(self, **changed: object) -> Calibrating:
        """Set some of what it shows."""
        self.shown = Calibrating.model_validate({**self.shown.model_dump(), **changed})
        return self.shown

    def view(self) -> Calibrating:
        return self.shown

    def begin(self, order: CalibratingOrder) -> Calibrating:
        self.orders.append(order)
        return self.show(state=CalibratingState.LOOKING, lenses=(), saved=False)

    def end(self) -> Calibrating:
        return self.show(state=CalibratingState.OFF)

    def undo(self) -> Calibrating:
        if not self.shown.taken:
            raise StateForbidsError("there is no picture to take away: hold the target still before the cameras")
        return self.show(taken=self.shown.taken - 1)

    def compute(self) -> Calibrating:
        if not self.shown.taken:
            raise StateForbidsError("there are no pictures to compute from: hold the target before the cameras first")
        return self.show(state=CalibratingState.COMPUTING)

    def save(self) -> Calibrating:
        if self.shown.state is not CalibratingState.DONE:
            raise StateForbidsError("there is no calibration yet: compute it, then put it into the rig file")
        return self.show(saved=True)

    def protocol(self) -> Path:
        if self.page is None:
            raise StateForbidsError("there is no protocol yet: compute the calibration first")
        return self.page
