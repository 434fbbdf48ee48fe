"""Long work that several people ask for, done one at a time by programs of their own; each asks for one at most.

What a program is given and what it has come to are any objects: they go through pickled files. While the computer has
something better to do, such as a recording, the program stands still.
"""

import pickle
import tempfile
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final, Generic, TypeVar

from rig.background.child import run_child
from rig.background.messages import End, Failed, Order, Progress
from rig.background.program import Teller, serve
from rig.errors import SvevError
from rig.phrase import Phrase, phrase

State = TypeVar("State")
_ORDER, _ANSWER = "order", "answer"
_ENDED: Final = phrase("errand_ended", "the program that does this was ended by something else: try again")


class ErrandOrder(Order):
    """Do what the file in this folder says."""

    folder: Path


class ErrandDone(End):
    """What it has come to is in a file beside it."""


class Errands(Generic[State]):
    """How far the errand of each person is. Any thread may call any method.

    Args:
        program: main module that does them; it calls `run_errand`.
        nothing: state of those who have asked for nothing.
        busy: whether programs have to stand still at present; None: there is nothing better to do on this computer.
        heard: gives the state from the one before and how far the program is, or whether it stands still.
        done: gives the state from who asked, the program's result, and the folder of its files, which is removed
            afterwards. It may take long, and raise OSError or SvevError.
        failed: gives the state from the one before the errand and the reason.
        folder: in which programs get a folder for their files; made if it is missing. None: that of the system.
        yielding: whether programs take only the processor time that nobody else wants, also where nothing is recorded.
    """

    def __init__(
        self,
        program: str,
        nothing: State,
        busy: Callable[[], bool] | None,
        *,
        heard: Callable[[State, Progress | bool], State],
        done: Callable[[str, Any, Path], State],
        failed: Callable[[State, Phrase], State],
        folder: Path | None = None,
        yielding: bool = False,
    ) -> None:
        self._yielding = yielding or busy is not None
        self._program, self._nothing, self._busy = program, nothing, busy
        self._heard, self._done, self._failed, self._folder = heard, done, failed, folder
        self._states: dict[str, State] = {}
        self._wanted: set[str] = set()
        self._closed = False
        self._threads: dict[str, threading.Thread] = {}
        self._lock, self._one_at_a_time = threading.RLock(), threading.Lock()

    def state(self, who: str) -> State:
        """How far it is, and what it gave."""
        return self._states.get(who, self._nothing)

    def works(self, who: str) -> bool:
        """Whether an errand of somebody is under way."""
        return who in self._wanted

    def begin(self, who: str, working: State, order: Callable[[], object]) -> State:
        """Begin an errand; if one of the same person is under way, or all is closed, nothing begins.

        Args:
            who: asks for it.
            working: its state from now on.
            order: gives what the program is given; what it raises is raised here, and nothing begins.
        """
        with self._lock:
            if who in self._wanted:
                return self.state(who)
            thread = self._threads.get(who)
        if thread is not None:
            thread.join()  # one that was cancelled ends within a moment
        with self._lock:
            if self._closed or who in self._wanted:
                return self.state(who)
            ordered, before = order(), self.state(who)
            self._states[who] = working
            self._wanted.add(who)
            thread = threading.Thread(target=self._work, args=(who, ordered, before), name=self._program, daemon=True)
            self._threads[who] = thread
            thread.start()
        return working

    def adopt(self, who: str, state: State) -> State:
        """Take a state that was reached without a program, unless one is under way."""
        with self._lock:
            if who not in self._wanted:
                self._states[who] = state
            return self.state(who)

    def cancel(self, who: str) -> State:
        """Do it no further; if it was under way, nothing is known any more."""
        with self._lock:
            if who in self._wanted:
                self._wanted.discard(who)
                self._states.pop(who, None)
            return self.state(who)

    def wait(self, who: str, timeout_s: float) -> None:
        """Wait until nothing of somebody's is under way."""
        if (thread := self._threads.get(who)) is not None:
            thread.join(timeout_s)

    def close(self) -> None:
        """End what is being done; nothing begins any more."""
        with self._lock:
            self._closed = True
            self._wanted.clear()
            threads = list(self._threads.values())
        for thread in threads:
            thread.join()

    def _work(self, who: str, ordered: object, before: State) -> None:
        state = None
        try:
            with self._one_at_a_time:
                state = self._ended(who, ordered, before)
        except ChildProcessError:
            state = self._failed(before, _ENDED)
        except SvevError as error:
            state = self._failed(before, error.said)
        except OSError as error:
            state = self._failed(before, _refused(self._folder or Path(tempfile.gettempdir()), error))
        finally:
            with self._lock:
                if state is not None and who in self._wanted:
                    self._states[who] = state
                self._wanted.discard(who)

    def _ended(self, who: str, ordered: object, before: State) -> State | None:
        """The state at the end; None if nobody wants it any more."""
        if self._folder is not None:
            self._folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".svev-", dir=self._folder) as folder:
            Path(folder, _ORDER).write_bytes(pickle.dumps(ordered))
            end = run_child(
                self._program,
                ErrandOrder(folder=Path(folder)),
                Progress | ErrandDone,
                busy=self._busy or (lambda: False),
                wanted=lambda: who in self._wanted,
                tell=lambda news: self._hear(who, news),
                hold=lambda held: self._hear(who, held),
                yielding=self._yielding,
            )
            if end is None or not self.works(who):
                return None
            if isinstance(end, Failed):
                return self._failed(before, end.said)
            answer = pickle.loads(Path(folder, _ANSWER).read_bytes())  # noqa: S301 - our program wrote it just now
            return self._done(who, answer, Path(folder))

    def _hear(self, who: str, news: Progress | bool) -> None:
        with self._lock:
            if who in self._wanted:
                self._states[who] = self._heard(self._states[who], news)


def run_errand(work: Callable[[Any, Path, Teller], object]) -> None:
    """Do one errand; the whole of such a program.

    Args:
        work: takes the order, a folder for files, and whom to tell, and gives its result.
    """

    def do(what: ErrandOrder, tell: Teller) -> ErrandDone:
        order = pickle.loads(Path(what.folder, _ORDER).read_bytes())  # noqa: S301 - the service wrote it just now
        Path(what.folder, _ANSWER).write_bytes(pickle.dumps(work(order, what.folder, tell)))
        return ErrandDone()

    serve({ErrandOrder: do})


def _refused(folder: Path, error: OSError) -> Phrase:
    return phrase(
        "errand_refused",
        "{path}: {trouble}; make room, and try again",
        path=str(folder),
        trouble=error.strerror or str(error),
    )
