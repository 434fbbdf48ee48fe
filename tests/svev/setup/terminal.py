"""A terminal at which a command runs and a test types."""

import os
import pty
import select
import subprocess
import sys
import time
from types import TracebackType
from typing import Self

_DEADLINE_S = 60.0


class Terminal:
    """`svev ARGUMENTS` at a pseudo-terminal of its own; a context manager that ends it."""

    def __init__(self, *arguments: str) -> None:
        self._ours, theirs = pty.openpty()
        environment = os.environ | {"LANG": "C.UTF-8", "COLUMNS": "200", "TERM": "dumb"}
        # setsid gives the command this terminal for its own, so that the Ctrl-C that is typed reaches it.
        command = ["setsid", "--ctty", sys.executable, "-m", "svev", *arguments]
        self._process = subprocess.Popen(
            command, stdin=theirs, stdout=theirs, stderr=theirs, close_fds=True, env=environment
        )
        os.close(theirs)
        self.shown = ""
        self._read = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.kill()
        self._process.wait(_DEADLINE_S)
        os.close(self._ours)

    def await_text(self, text: str) -> str:
        """Wait until this stands on the terminal, behind what was awaited before.

        Returns:
            What stands between.
        """
        deadline = time.monotonic() + _DEADLINE_S
        while (found := self.shown.find(text, self._read)) < 0:
            assert time.monotonic() < deadline, f"no {text!r} in: {self.shown[self._read :]}"
            assert self._more(), f"ended without {text!r}: {self.shown}"
        between = self.shown[self._read : found]
        self._read = found + len(text)
        return between

    def answer(self, question: str, text: str) -> str:
        """Wait for a question and type an answer and Enter.

        Returns:
            What stood before the question.
        """
        before = self.await_text(question)
        self.type(f"{text}\n")
        return before

    def type(self, text: str) -> None:
        """Type."""
        os.write(self._ours, text.encode())

    def send_signal(self, number: int) -> None:
        """Send the command a signal."""
        self._process.send_signal(number)

    def end(self) -> int:
        """Wait for the end of the command.

        Returns:
            Its exit code.
        """
        deadline = time.monotonic() + _DEADLINE_S
        while self._more():
            assert time.monotonic() < deadline, self.shown
        return self._process.wait(_DEADLINE_S)

    def _more(self) -> bool:
        """Read what comes within a second; False: nothing will any more."""
        if select.select([self._ours], [], [], 1.0)[0]:
            try:
                read = os.read(self._ours, 65536)
            except OSError:  # the other end is closed
                return False
            self.shown += read.decode(errors="replace").replace("\r\n", "\n")
            return bool(read)
        return True
