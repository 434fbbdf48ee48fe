"""The frame of such a program: what it is asked, and how it says how far it is."""

import json
import os
import sys
import time
from collections.abc import Callable
from typing import Any, Final

from rig.background.child import AT_ONCE, READY
from rig.errors import SvevError
from rig.host.endings import be_killed_with_parent
from rig.phrase import as_plain, plain

_NICE: Final = 19
#: Between two lines that say how far it is.
_TELL_S: Final = 0.1


class Teller:
    """Says how far the work is."""

    def __init__(self) -> None:
        self._told = 0.0

    def __call__(self, *, last: bool = False, **news: object) -> None:
        """Say it, unless something was said a moment ago.

        Args:
            last: of its kind; it is said in any case.
            news: what is said.
        """
        if last or time.monotonic() - self._told > _TELL_S:
            self._told = time.monotonic()
            _say(news)


def serve(work: Callable[[dict[str, Any], Teller], dict[str, Any]]) -> None:
    """Do the work that the first line of standard input asks for, and say what it has come to.

    It ends with the service, also while it stands still: the kernel kills it.

    Args:
        work: takes what is asked and whom to tell; its libraries are to be imported within, so that their threads have
            our low priority too.
    """
    if AT_ONCE not in sys.argv[1:]:
        os.nice(_NICE)
        os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
    be_killed_with_parent()
    _say(READY)  # fails if the service has ended before that
    asked: dict[str, Any] = json.loads(sys.stdin.readline())
    try:
        end = work(asked, Teller())
    except SvevError as error:
        end = {"problem": as_plain(error.said)}
    except OSError as error:
        end = {"problem": as_plain(plain(str(error)))}
    _say({"end": end})


def _say(what: dict[str, Any]) -> None:
    sys.stdout.write(json.dumps(what) + "\n")
    sys.stdout.flush()
