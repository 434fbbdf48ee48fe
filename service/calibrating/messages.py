"""Orders to the programs of the calibration helper, and their answers."""

from collections.abc import Mapping
from pathlib import Path

from rig.api.calibrating import CalibratedLens, CalibratingOrder, SeenTarget
from rig.api.statement import Level, Statement
from rig.background.messages import End, Order
from rig.phrase import Phrase
from rig.settings.model import RigSettings
from rig.transport.message import Message


class Find(Order):
    """Look at live pictures for targets, and keep those in which they are still; ends with its caller.

    Attributes:
        fd: descriptor of the memory with the newest triplet.
        rig: whose triplets they are.
        folder: of the kept pictures.
        printed: what was printed.
    """

    fd: int
    rig: RigSettings
    folder: Path
    printed: CalibratingOrder


class Looked(Message):
    """What the last pictures show.

    Attributes:
        problem: what is wrong; None: nothing.
        still: whether the target is still.
        cameras: what each camera has seen; None: nothing could be found.
    """

    problem: Statement | None = None
    still: bool = False
    cameras: Mapping[str, SeenTarget] | None = None


class Compute(Order):
    """Calibrate with the pictures of a set, as `svev calibrate` does; its folder gets network, result and protocol."""

    folder: Path
    printed: CalibratingOrder


class Computed(End):
    """What the calibration says of each camera."""

    lenses: tuple[CalibratedLens, ...]


def as_error(said: Phrase) -> Statement:
    """Why nothing is found or computed."""
    return stated(said).model_copy(update={"level": Level.ERROR})


def stated(said: Phrase) -> Statement:
    """A sentence for the page."""
    return Statement(code=said.code, text=said.text, values=said.values)
