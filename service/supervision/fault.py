"""Remembers the fault of the rig, if it has one, and when the supervisor may try again."""

import time

from rig.api.statement import Statement
from rig.errors import SvevError
from rig.phrase import Phrase, phrase
from rig.transport.process_table import BackOff
from service.status.statements import failed


class Fault:
    """The present fault. Only the supervisor's thread uses it.

    Attributes:
        statement: the fault in words, None if there is none.
        cause: the error behind the fault, None if there is none.
    """

    def __init__(self) -> None:
        self.statement: Statement | None = None
        self._back_off = BackOff()
        self._again_at = 0.0
        self._complaint: SvevError | None = None
        self.cause: SvevError | None = None

    @property
    def deaths(self) -> int:
        """How many times the recorder died or could not be started."""
        return self._back_off.deaths

    @property
    def may_try(self) -> bool:
        """Whether it is time to try again."""
        return time.monotonic() >= self._again_at

    def complain(self, error: SvevError) -> None:
        """Note the error with which the recorder says that it is about to end."""
        self._complaint = error

    def fail(self, error: SvevError, lived_s: float, *, hurry: bool = False) -> Phrase:
        """Note that setting up failed or that the recorder died.

        Args:
            error: the error; a complaint of the recorder, if there is one, is used instead, since it says more.
            lived_s: how long the rig had worked, s.
            hurry: try again at once, because a recording is to go on.

        Returns:
            What happened and when the supervisor tries again, in words.
        """
        wait_s = self._back_off.died(lived_s)
        if hurry:
            wait_s = 0.0
        self._again_at = time.monotonic() + wait_s
        self.cause = self._complaint or error
        self.statement = failed(self.cause, wait_s)
        why = self.cause.said
        if not wait_s:
            return phrase("event_starting_at_once", "{why}; starting again at once", why=why)
        return phrase("event_starting_again", "{why}; starting again in {seconds:g} s", why=why, seconds=wait_s)

    def refuse(self, statement: Statement) -> None:
        """Note why the rig is not armed, as `statement` says, although its processes run; they go on trying."""
        self.statement = statement

    def clear(self) -> None:
        """Forget the fault: it is over, or the supervisor tries again."""
        self.statement = self.cause = self._complaint = None

    def hurry(self) -> None:
        """Forget the fault and try at once, because a person asked for it."""
        self.clear()
        self._again_at = 0.0
        self._back_off.forget()
