"""Computes jumps from what operators measured, as `svev analyze` does, into folders beside their marks.

A program of its own computes, so that measuring goes on as fast as before; while a recording runs it stands still.
"""

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from analysis.cameras.source import Source
from analysis.measurements.model import Measurements
from rig.api.digitizing import HandResult
from rig.background.errands import Errands
from rig.background.messages import Progress
from rig.host.disk import sync
from rig.phrase import Phrase

_SUFFIX: Final = ".result"
#: Where the program leaves the files of a result.
RESULT: Final = "result"


@dataclass(frozen=True, slots=True)
class JumpOrder:
    """What to compute: from which log, what counts, and where the cameras come from."""

    log: Path
    measurements: Measurements
    source: Source


@dataclass(frozen=True, slots=True)
class ComputedJump:
    """What a page shows of a result.

    Attributes:
        said: the verdicts, sentence by sentence.
        files: names of the files in the folder.
    """

    said: tuple[Phrase, ...]
    files: tuple[str, ...]


class Computing:
    """The results of one log's operators, computed one at a time. Any thread may call any method.

    Args:
        log: the log.
        folder: of the marks; a result stands in `OPERATOR.result` there, whole or absent.
        busy: whether a recording runs, so that the work has to stand still; None: nothing is recorded on this computer.
    """

    def __init__(self, log: Path, folder: Path, busy: Callable[[], bool] | None) -> None:
        self._log, self._folder = log, folder
        self._errands = Errands(
            "analysis.digitizing.programs.computing_program",
            HandResult(state="none"),
            busy,
            heard=_heard,
            done=self._done,
            failed=lambda _, why: HandResult(state="failed", problem=why),
            folder=folder,
        )

    def begin(self, operator: str, order: Callable[[], tuple[Measurements, Source]]) -> HandResult:
        """Begin to compute; if it is computing already, nothing begins.

        Args:
            operator: whose marks.
            order: gives what counts, and where the cameras come from.

        Raises:
            SvevError: of `order`.
        """

        def ordered() -> JumpOrder:
            return JumpOrder(self._log, *order())

        return self._errands.begin(operator, HandResult(state="computing"), ordered)

    def cancel(self, operator: str) -> HandResult:
        """Compute no further; an earlier result stays."""
        return self._errands.cancel(operator)

    def close(self) -> None:
        """End what is being computed."""
        self._errands.close()

    def result(self, operator: str) -> HandResult:
        """How far the computing is, and what it gave."""
        return self._errands.state(operator)

    def file(self, operator: str, name: str) -> Path | None:
        """A file of a result; None: there is none of this name."""
        found = self._folder / f"{operator}{_SUFFIX}" / name
        return found if found.is_file() and found.parent.parent == self._folder else None

    def _done(self, operator: str, computed: ComputedJump, made: Path) -> HandResult:
        whole = self._folder / f"{operator}{_SUFFIX}"
        for file in (made / RESULT).iterdir():
            sync(file)
        shutil.rmtree(whole, ignore_errors=True)
        (made / RESULT).rename(whole)
        sync(self._folder)
        return HandResult(state="done", said=computed.said, files=computed.files)


def _heard(state: HandResult, news: Progress | bool) -> HandResult:
    if isinstance(news, bool):
        return state.model_copy(update={"paused": news})
    return state.model_copy(update={"step": news.step, "share": news.share})
