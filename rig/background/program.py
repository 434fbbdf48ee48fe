"""The frame of such a program: what it is asked, how it says how far it is, and how it stands still."""

import json
import os
import sys
import threading
import time
from collections.abc import Callable
from typing import Any, Final

from rig.background.child import AT_ONCE
from rig.errors import SvevError
from rig.phrase import as_plain, plain

_NICE: Final = 19
#: Between two lines that say how far it is.
_TELL_S: Final = 0.1


class Teller:
    """Says how far the work is, and holds it while it has to stand still."""

    def __init__(self) -> None:
        self._going, self._told = threading.Event(), 0.0
        self._going.set()
        threading.Thread(target=self._obey, daemon=True).start()

    def __call__(self, *, last: bool = False, **news: object) -> None:
        """Say it, unless something was said a moment ago.

        Args:
            last: of its kind; it is said in any case.
            news: what is said.
        """
        self._going.wait()
        if last or time.monotonic() - self._told > _TELL_S:
            self._told = time.monotonic()
            _say(news)

    def _obey(self) -> None:
        for line in sys.stdin:
            if line.strip() == "pause":
                self._going.clear()
            else:
                self._going.set()
        os._exit(1)


def serve(work: Callable[[dict[str, Any], Teller], dict[str, Any]]) -> None:
    """Do the work that the first line of standard input asks for, and say what it has come to.

    Every further line is "pause" or "go"; the end of standard input, which is also that of the service, ends it.

    Args:
        work: takes what is asked and whom to tell; its libraries are to be imported within, so that their threads have
            our low priority too.
    """
    if AT_ONCE not in sys.argv[1:]:
        os.nice(_NICE)
        os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
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
