"""Tells whether this process was stopped (SIGSTOP) and continued: a frozen camera sees no pulses.

SIGCONT continues a stopped process even where it is blocked, and then stays pending until somebody looks. So the
sensor can ask, before it exposes a late pulse, why it is late: frozen, or only scheduled late.
"""

import signal


def watch() -> None:
    """Begin to watch; to be called by the main thread before any other is started."""
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGCONT})


def was_frozen() -> bool:
    """Whether the process was stopped since the last call."""
    return signal.SIGCONT in signal.sigpending() and signal.sigtimedwait({signal.SIGCONT}, 0) is not None
