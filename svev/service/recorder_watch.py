"""What the recorder's reports say of the recorder itself: that it lives, and how fast pulses come."""

import time
from typing import Final

from rig.control import Message
from svev.rig_processes import RigProcesses
from svev.service.pulse_rate import PulseRate

#: A recorder that has not reported for so long is stuck. Closing a log on a slow disk may take a while.
STUCK_S: Final = 20.0
#: Not to be called healthy any more.
_LATE_S: Final = 10.0


class RecorderWatch:
    """Fed by the supervisor; `late` may be asked by any thread.

    Attributes:
        pulses: how fast they come.
    """

    def __init__(self) -> None:
        self.pulses = PulseRate()
        self._reported = time.monotonic()

    def hear(self, message: Message) -> None:
        """A report."""
        self._reported = time.monotonic()
        if message["report"] == "health":
            self.pulses.count(message["pairing"]["pulses"], self._reported)

    def expect_nothing(self) -> None:
        """There is no recorder now."""
        self._reported = time.monotonic()
        self.pulses.forget()

    def stuck(self, processes: RigProcesses) -> bool:
        """Whether the recorder has given no sign of life for too long."""
        return time.monotonic() > max(self._reported, processes.started) + STUCK_S

    @property
    def late(self) -> bool:
        """Whether a report is overdue."""
        return time.monotonic() > self._reported + _LATE_S
