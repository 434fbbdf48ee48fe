"""Await a condition with a deadline, instead of sleeping and hoping."""

import time
from collections.abc import Callable


def wait_until(condition: Callable[[], bool], what: str, timeout_s: float = 5.0, poll_s: float = 0.01) -> None:
    """Return as soon as `condition` holds.

    Args:
        condition: what is awaited.
        what: names the condition in the failure, e.g. "the grabber is gone".
        timeout_s: how long to wait at most.
        poll_s: time between two looks.

    Raises:
        AssertionError: the condition did not come true in time.
    """
    deadline = time.monotonic() + timeout_s
    while not condition():
        if time.monotonic() > deadline:
            raise AssertionError(f"after {timeout_s} s still not so: {what}")
        time.sleep(poll_s)
