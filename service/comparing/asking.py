"""Has measured jumps compared by a program of its own, one comparison at a time, none while a recording runs."""

import threading
import time
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from datetime import date
from functools import partial
from pathlib import Path
from typing import Final, TypeVar

from recorder.catalogue.entry import SUFFIX
from rig.api.athletes import AthleteJump
from rig.api.comparison import Comparison, Span
from rig.api.statement import Level
from rig.background.child import run_child
from rig.background.messages import End, Failed, Order
from rig.errors import BadInputError, StateForbidsError
from rig.phrase import phrase
from service.comparing.program import Compared, CompareGroups, JumpFile, ShowBeside, Shown
from service.measuring.results import result_file

Answer = TypeVar("Answer", bound=End)

#: Two jumps take some two seconds, a season of one athlete some ten.
_DEADLINE_S: Final = 60.0
#: So many jumps of a span are compared, and so many of other days tell the scatter: the newest ones.
_MOST_JUMPS: Final = 100
_MOST_OTHER_JUMPS: Final = 60


class Comparisons:
    """Any thread may call any method.

    Args:
        directory: folder of the recordings.
        busy: whether a recording runs.
    """

    def __init__(self, directory: Path, busy: Callable[[], bool]) -> None:
        self._directory, self._busy = directory, busy
        self._turn = threading.Lock()

    def spans(self, jumps: Sequence[AthleteJump], first: Span, second: Span) -> Comparison:
        """Compare an athlete's jumps of two spans; those of other days tell how his jumps scatter.

        Args:
            jumps: all of his, newest first.
            first: a span.
            second: another one.

        Raises:
            StateForbidsError: a recording runs.
            BadInputError: there are too few jumps, the spans overlap, or the jumps cannot be compared.
        """
        if first.since < second.until and second.since < first.until:
            raise BadInputError(phrase("comparing_overlap", "the spans overlap: choose two that have no day in common"))
        compared = [[each for each in jumps if span.since <= each.jump.time < span.until] for span in (first, second)]
        groups = [self._comparable(group)[:_MOST_JUMPS] for group in compared]
        used = [len(group) for group in groups]
        if not all(used):
            raise BadInputError(
                phrase("comparing_empty", "a span has no jump that was measured well: choose another one")
            )
        days: dict[date, list[AthleteJump]] = defaultdict(list)
        for each in (each for each in jumps if not any(each in group for group in compared)):
            days[each.jump.time.date()].append(each)
        others = [self._comparable(day) for day in days.values()]
        left_out = sum(len(group) for group in compared) - sum(used)
        asked = tuple(map(tuple, (*groups, *_up_to(_MOST_OTHER_JUMPS, others))))
        return self._ask(CompareGroups(groups=asked, left_out=left_out), Compared).comparison

    def page(self, jumps: Sequence[AthleteJump], others: Sequence[AthleteJump], language: str) -> str:
        """The page that shows two jumps side by side.

        Args:
            jumps: two.
            others: further jumps of the athlete, if it is one and the same: they tell how his jumps scatter.
            language: that the page shows first.

        Raises:
            StateForbidsError: a recording runs.
            BadInputError: one was not measured in the whole log, or they cannot be compared.
        """
        shown = self._measured(jumps)
        if len(shown) < len(jumps):
            raise BadInputError(
                phrase("comparing_unmeasured", "one of the jumps was not measured in its log: measure it, then compare")
            )
        asked = tuple(shown + self._comparable(others)[:_MOST_OTHER_JUMPS])
        return self._ask(ShowBeside(jumps=asked, language=language), Shown).page

    def _comparable(self, jumps: Sequence[AthleteJump]) -> list[JumpFile]:
        """Those that were measured well in the whole log, with the file of their result."""
        return self._measured([each for each in jumps if each.level is Level.GOOD])

    def _measured(self, jumps: Sequence[AthleteJump]) -> list[JumpFile]:
        """Those whose log was measured, with the file of their result."""
        found = []
        for each in jumps:
            log = self._directory / f"{each.jump.recording}{SUFFIX}"
            file = None if each.level is Level.INFO else result_file(log, "jumper.json")
            if file is not None:
                who = each.athlete.strip()
                found.append(JumpFile(log=log, file=file, jump=each.jump.jump, athlete=who, bib=each.bib))
        return found

    def _ask(self, order: Order, answer: type[Answer]) -> Answer:
        deadline = time.monotonic() + _DEADLINE_S
        if self._busy() or not self._turn.acquire(timeout=_DEADLINE_S):
            raise StateForbidsError(
                phrase(
                    "comparing_recording", "jumps are not compared while a recording runs: try again when it has ended"
                )
            )
        try:
            wanted = partial(_before, deadline)
            end = run_child("service.comparing.program", order, answer, busy=self._busy, wanted=wanted)
        except OSError as error:
            raise StateForbidsError(
                phrase("comparing_failed", "the jumps cannot be compared ({why}): try again", why=str(error.strerror))
            ) from error
        finally:
            self._turn.release()
        if isinstance(end, Failed):
            raise BadInputError(end.said.text)
        if not isinstance(end, answer):
            raise StateForbidsError(
                phrase(
                    "comparing_late",
                    "the jumps are not compared yet after a minute: try again when nothing is recorded",
                )
            )
        return end


def _before(deadline: float) -> bool:
    return time.monotonic() < deadline


def _up_to(most: int, groups: Iterable[list[JumpFile]]) -> Iterator[list[JumpFile]]:
    """Groups of two or more, as long as they have no more than `most` together."""
    for group in groups:
        most -= len(group)
        if most < 0:
            return
        if len(group) > 1:
            yield group
