"""Has measured jumps compared by a program of its own, one comparison at a time, none while a recording runs."""

import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

from recorder.catalogue.entry import SUFFIX
from rig.api.athletes import AthleteJump
from rig.api.comparison import Comparison
from rig.api.statement import Level
from rig.errors import BadInputError, StateForbidsError
from service.background.child import run_child
from service.measuring.results import result_file

#: Two jumps take some two seconds, a season of one athlete some ten.
_DEADLINE_S: Final = 60.0
#: So many jumps of a group are compared, the newest ones.
_MOST: Final = 200


class Comparisons:
    """Any thread may call any method.

    Args:
        directory: folder of the recordings.
        busy: whether a recording runs.
    """

    def __init__(self, directory: Path, busy: Callable[[], bool]) -> None:
        self._directory, self._busy = directory, busy
        self._turn = threading.Lock()

    def groups(self, first: Sequence[AthleteJump], second: Sequence[AthleteJump]) -> Comparison:
        """Compare two groups of jumps.

        Raises:
            StateForbidsError: a recording runs.
            BadInputError: there are too few jumps, or they cannot be compared.
        """
        groups = [self._comparable(group) for group in (first, second)]
        used = [len(group) for group in groups]
        if not all(used):
            raise BadInputError("a span has no jump that was measured well: choose another one")
        end = self._ask({"first": groups[0], "second": groups[1]})
        left_out = len(first) + len(second) - sum(used)
        return Comparison.model_validate(end | {"first": used[0], "second": used[1], "left_out": left_out})

    def _comparable(self, jumps: Sequence[AthleteJump]) -> list[dict[str, Any]]:
        """Those that were measured well in the whole log, with the file of their result."""
        found = []
        for each in jumps:
            log = self._directory / f"{each.jump.recording}{SUFFIX}"
            if each.level is Level.GOOD and (file := result_file(log, "jumper.json")) is not None:
                found.append({"file": str(file), "jump": each.jump.jump, "name": each.athlete or each.jump.recording})
        return found[:_MOST]

    def _ask(self, what: dict[str, Any]) -> dict[str, Any]:
        deadline = time.monotonic() + _DEADLINE_S
        if self._busy() or not self._turn.acquire(timeout=_DEADLINE_S):
            raise StateForbidsError("jumps are not compared while a recording runs: try again when it has ended")
        try:
            end = run_child(
                "service.comparing.program",
                what,
                busy=self._busy,
                wanted=lambda: time.monotonic() < deadline,
                tell=lambda _: None,
                hold=lambda _: None,
            )
        except OSError as error:
            raise StateForbidsError(f"the jumps cannot be compared ({error.strerror}): try again") from error
        finally:
            self._turn.release()
        if end is None:
            raise StateForbidsError("the jumps are not compared yet after a minute: try again when nothing is recorded")
        if "problem" in end:
            raise BadInputError(end["problem"]["text"])
        return end
