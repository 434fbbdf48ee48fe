"""The fault of the rig, if it has one, and when it is tried again."""

import time

from rig.errors import SvevError
from svev.back_off import BackOff
from svev.service.statements import failed, no_camera
from webpanel.models import Statement


class Fault:
    """Used by the supervisor.

    Attributes:
        statement: the fault in words, None if there is none.
    """

    def __init__(self) -> None:
        self.statement: Statement | None = None
        self._back_off = BackOff()
        self._again_at = 0.0
        self._complaint: SvevError | None = None

    @property
    def deaths(self) -> int:
        """How often the recorder died, or would not start."""
        return self._back_off.deaths

    @property
    def may_try(self) -> bool:
        """Whether it is time to try again."""
        return time.monotonic() >= self._again_at

    def complain(self, error: SvevError) -> None:
        """The recorder says why it is about to end."""
        self._complaint = error

    def fail(self, error: SvevError, lived_s: float) -> str:
        """Setting up failed, or the recorder died.

        Args:
            error: in general words; a complaint of the recorder says it better.
            lived_s: how long all was well, s.

        Returns:
            What happened, and when it is tried again.
        """
        wait_s = self._back_off.died(lived_s)
        self._again_at = time.monotonic() + wait_s
        error = self._complaint or error
        self.statement = failed(error, wait_s)
        return f"{error}; starting again in {wait_s:g} s"

    def lack_cameras(self) -> None:
        """None of the cameras answers; they are waited for."""
        self.statement = no_camera()

    def clear(self) -> None:
        """It is over, or tried again."""
        self.statement = self._complaint = None

    def hurry(self) -> None:
        """Somebody has seen to it: try at once."""
        self.clear()
        self._again_at = 0.0
        self._back_off.forget()
