"""Computes jumps from what operators measured, as `svev analyze` does, into folders beside their marks.

A program of its own computes, so that measuring goes on as fast as before; while a recording runs it stands still.
"""

import os
import pickle
import shutil
import tempfile
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from analysis.cameras.source import Source
from analysis.measurements.model import Measurements
from rig.api.digitizing import HandResult
from rig.api.measuring import MeasuringStep
from rig.background.child import run_child
from rig.phrase import Phrase, from_plain, phrase, plain

_SUFFIX: Final = ".result"
_PROGRAM: Final = "analysis.digitizing.computing_program"
_ENDED: Final = phrase("hand_ended", "the program that computes was ended by something else: compute again")


class Computing:
    """The results of one log's operators, computed one at a time. Any thread may call any method.

    Args:
        log: the log.
        folder: of the marks; a result stands in `OPERATOR.result` there, whole or absent.
        busy: whether a recording runs, so that the work has to stand still; None: nothing is recorded on this computer.
    """

    def __init__(self, log: Path, folder: Path, busy: Callable[[], bool] | None) -> None:
        self._log, self._folder, self._busy = log, folder, busy
        self._states: dict[str, HandResult] = {}
        self._wanted: set[str] = set()
        self._threads: dict[str, threading.Thread] = {}
        self._lock, self._one_at_a_time = threading.Lock(), threading.Lock()

    def begin(self, operator: str, order: Callable[[], tuple[Measurements, Source]]) -> HandResult:
        """Begin to compute; if it is computing already, nothing begins.

        Args:
            operator: whose marks.
            order: gives what counts, and where the cameras come from.

        Raises:
            SvevError: of `order`.
        """
        with self._lock:
            if operator in self._wanted:
                return self._states[operator]
            thread = self._threads.get(operator)
        if thread is not None:
            thread.join()  # one that was cancelled ends within a moment
        with self._lock:
            if operator in self._wanted:
                return self._states[operator]
            ordered = order()
            state = self._states[operator] = HandResult(state="computing")
            self._wanted.add(operator)
            thread = threading.Thread(
                target=self._work, args=(operator, ordered), name="computing by hand", daemon=True
            )
            self._threads[operator] = thread
            thread.start()
        return state

    def cancel(self, operator: str) -> HandResult:
        """Compute no further; an earlier result stays."""
        with self._lock:
            if operator in self._wanted:
                self._wanted.discard(operator)
                self._states[operator] = HandResult(state="none")
            return self.result(operator)

    def close(self) -> None:
        """End what is being computed."""
        with self._lock:
            self._wanted.clear()
            threads = list(self._threads.values())
        for thread in threads:
            thread.join()

    def result(self, operator: str) -> HandResult:
        """How far the computing is, and what it gave."""
        return self._states.get(operator, HandResult(state="none"))

    def file(self, operator: str, name: str) -> Path | None:
        """A file of a result; None: there is none of this name."""
        found = self._folder / f"{operator}{_SUFFIX}" / name
        return found if found.is_file() and found.parent.parent == self._folder else None

    def _work(self, operator: str, order: tuple[Measurements, Source]) -> None:
        with self._one_at_a_time:
            try:
                state = self._computed(operator, order)
            except ChildProcessError:
                state = _failed(_ENDED)
            except OSError as error:
                state = _failed(plain(f"{self._folder}: {error.strerror or error}; make room, and compute again"))
        with self._lock:
            if state is not None and operator in self._wanted:
                self._states[operator] = state
            self._wanted.discard(operator)

    def _computed(self, operator: str, order: tuple[Measurements, Source]) -> HandResult | None:
        """The result; None if nobody wants it any more."""
        whole = self._folder / f"{operator}{_SUFFIX}"
        making = self._folder / f".{operator}{_SUFFIX}.{os.getpid()}"
        shutil.rmtree(making, ignore_errors=True)
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryDirectory(prefix="svev-") as folder:
                end = self._ended(operator, Path(folder, "order"), order, making)
            if end is None:
                return None
            if "problem" in end:
                return _failed(from_plain(end["problem"]))
            shutil.rmtree(whole, ignore_errors=True)
            making.rename(whole)
            said = tuple(map(from_plain, end["said"]))
            return HandResult(state="done", said=said, curves=end["curves"], files=end["files"])
        finally:
            shutil.rmtree(making, ignore_errors=True)

    def _ended(
        self, operator: str, ordered: Path, order: tuple[Measurements, Source], making: Path
    ) -> dict[str, Any] | None:
        """What the program says at its end."""
        ordered.write_bytes(pickle.dumps(order))
        return run_child(
            _PROGRAM,
            {"log": str(self._log), "order": str(ordered), "out": str(making)},
            busy=self._busy or (lambda: False),
            wanted=lambda: operator in self._wanted,
            tell=lambda news: self._hear(operator, news),
            hold=lambda held: self._hear(operator, {"paused": held}),
            yielding=self._busy is not None,
        )

    def _hear(self, operator: str, news: dict[str, Any]) -> None:
        if "step" in news:
            news["step"] = MeasuringStep(news["step"])
        with self._lock:
            if operator in self._wanted:
                self._states[operator] = self._states[operator].model_copy(update=news)


def _failed(why: Phrase) -> HandResult:
    return HandResult(state="failed", problem=why)
