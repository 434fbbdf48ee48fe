"""What a program that does long work is told, and what it says; each program adds messages of its own."""

from rig.api.measuring import MeasuringStep
from rig.phrase import Phrase
from rig.transport.message import Message


class Order(Message):
    """What a program is to do; the first message to it, and the only one."""


class Ready(Message):
    """From now on the kernel kills the program if we end, so it may be made to stand still."""


class Progress(Message):
    """How far the work is.

    Attributes:
        share: of the step, or of the whole.
        step: what is being done; None: there is one step only.
    """

    share: float
    step: MeasuringStep | None = None


class End(Message):
    """What the work has come to; the last message of a program."""


class Failed(End):
    """The work cannot be done.

    Attributes:
        said: why.
    """

    said: Phrase
