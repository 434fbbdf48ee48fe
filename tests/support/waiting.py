"""Await a condition with a deadline, instead of sleeping and hoping."""

import time
from collections.abc import Callable
from typing import Final

#: How long a condition is awaited: it comes in a second or two, on a machine with much else to do it may take long.
PATIENCE_S: Final = 60.0
#: What is long in coming is looked at more rarely, after a further share of the time that was waited, but at least this
#: often: a look may be a call of a service, and takes processor time that what is awaited would need.
_SHARE: Final = 0.05
_RAREST_S: Final = 0.1


def wait_until(condition: Callable[[], bool], what: str, timeout_s: float = PATIENCE_S, poll_s: float = 0.01) -> None:
    """Return as soon as `condition` holds.

    Args:
        condition: what is awaited.
        what: names the condition in the failure, e.g. "the grabber is gone".
        timeout_s: how long to wait at most.
        poll_s: time between two looks, at first.

    Raises:
        AssertionError: the condition did not come true in time.
    """
    begun = time.monotonic()
    while not condition():
        waited = time.monotonic() - begun
        if waited > timeout_s:
            raise AssertionError(f"after {timeout_s} s still not so: {what}")
        time.sleep(max(poll_s, min(_SHARE * waited, _RAREST_S)))


def let_pass(seconds: float) -> None:
    """Let so much time pass, for what depends on nothing else."""
    until = time.monotonic() + seconds
    wait_until(lambda: time.monotonic() > until, f"{seconds} s pass", seconds + 10)
