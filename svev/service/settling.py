"""When the cameras of a rig that is being armed have settled."""

import time
from typing import Final

from svev.rig_processes import RigProcesses

#: A camera that has not said anything for so long is taken for absent.
_ANSWER_S: Final = 20.0
#: With pulses running, the first whole triplets are awaited: a recording then begins complete.
_WARM_S: Final = 2.0


class Settling:
    """Begins anew whenever arming does.

    Attributes:
        began: when, on the monotonic clock, s.
    """

    def __init__(self) -> None:
        self.began = 0.0
        self._tried_at: float | None = None

    def begin(self, now: float) -> None:
        """Arming begins."""
        self.began, self._tried_at = now, None

    def settled(self, processes: RigProcesses) -> bool:
        """Whether every camera has answered or failed, and those that are there had time for their first frames."""
        now = time.monotonic()
        tried = all(camera.tried for camera in processes.cameras) or now > self.began + _ANSWER_S
        if not processes.ready or not tried:
            return False
        if self._tried_at is None:
            self._tried_at = now
        lacking = not any(camera.present for camera in processes.cameras)
        return lacking or processes.warm or now > self._tried_at + _WARM_S
