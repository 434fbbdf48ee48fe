"""The parent's side of a process of simulated cameras (`simrig.camera_program`)."""

import json
import os
import selectors
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from rig.errors import BadInputError, ProcessDiedError

START_S = 30.0
_ANSWER_S = 10.0
_STOP_S = 3.0
_ROOT = Path(__file__).resolve().parent.parent


class CameraProcess:
    """One process, started by the constructor.

    The kernel kills it, frozen or not, as soon as the *thread* that called the constructor ends: call it in one that
    lives long enough. It sits in a process group of its own, so that Ctrl-C does not reach it.

    Args:
        module: what to run.
        config: what to tell it first.
        what: names it in messages.
    """

    def __init__(self, module: str, config: BaseModel, what: str) -> None:
        self._what = what
        self.frozen = self.killed = False
        paths = [str(_ROOT), *filter(None, [os.environ.get("PYTHONPATH")])]
        environment = {"PYTHONPATH": os.pathsep.join(paths), "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
        self._process = subprocess.Popen(
            [sys.executable, "-m", module],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, **environment},
            process_group=0,
            bufsize=0,
        )
        self._unread = b""
        self._say(config.model_dump_json())

    @property
    def pid(self) -> int:
        """Process id."""
        return self._process.pid

    @property
    def alive(self) -> bool:
        """Whether the process runs (or is frozen)."""
        return self._process.poll() is None

    def await_ready(self) -> None:
        """Wait until its cameras are there.

        Raises:
            BadInputError: it cannot be, for a reason that somebody can remove.
            ProcessDiedError: it ended, or took too long.
        """
        self._hear(START_S)

    def ask(self, command: dict[str, Any]) -> dict[str, Any]:
        """Send a command and wait for the answer.

        Raises:
            BadInputError: the process refuses the command.
            ProcessDiedError: it does not answer.
        """
        self._say(json.dumps(command))
        return self._hear(_ANSWER_S)

    def freeze(self) -> None:
        """Stop the process where it stands."""
        self._process.send_signal(signal.SIGSTOP)
        self.frozen = True

    def thaw(self) -> None:
        """Let it go on."""
        self._process.send_signal(signal.SIGCONT)
        self.frozen = False

    def begin_stop(self) -> None:
        """Ask the process to end, without waiting for it."""
        if self.frozen:
            self.thaw()
        if self._process.stdin is not None:
            self._process.stdin.close()

    def stop(self) -> None:
        """End the process: politely, then by force."""
        self.begin_stop()
        try:
            self._process.wait(_STOP_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
        self._close()

    def kill(self) -> None:
        """End the process by force (SIGKILL)."""
        self.killed = True
        self._process.kill()
        self._close()

    def _close(self) -> None:
        self._process.wait(_STOP_S)
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                pipe.close()

    def _say(self, line: str) -> None:
        assert self._process.stdin is not None  # noqa: S101  (for the type checker: it is a pipe)
        try:
            self._process.stdin.write(line.encode() + b"\n")
        except BrokenPipeError:
            raise self._died() from None

    def _hear(self, patience_s: float) -> dict[str, Any]:
        """One answer."""
        assert self._process.stdout is not None  # noqa: S101
        deadline = time.monotonic() + patience_s
        with selectors.DefaultSelector() as selector:
            selector.register(self._process.stdout, selectors.EVENT_READ)
            while b"\n" not in self._unread:
                if not selector.select(max(0.0, deadline - time.monotonic())):
                    self.kill()
                    raise ProcessDiedError(
                        f"{self._what} did not answer for {patience_s:.0f} s, so it was ended: restart it"
                    )
                part = os.read(self._process.stdout.fileno(), 1 << 16)
                if not part:
                    raise self._died()
                self._unread += part
        line, _, self._unread = self._unread.partition(b"\n")
        answer: dict[str, Any] = json.loads(line)
        if "error" in answer:
            raise BadInputError(answer["error"])
        return answer

    def _died(self) -> ProcessDiedError:
        code = self._process.wait(_STOP_S)
        return ProcessDiedError(f"{self._what} ended by itself (exit code {code}): see its messages above")


class ProcessOwner:
    """Base of what is made of one process that is started later, and perhaps again."""

    def __init__(self) -> None:
        self._process: CameraProcess | None = None

    @property
    def pid(self) -> int | None:
        """Its process id, None if it does not run."""
        return self._process.pid if self._process is not None and self._process.alive else None

    def begin_stop(self) -> None:
        """Ask it to end, without waiting."""
        if self._process is not None:
            self._process.begin_stop()

    def stop(self) -> None:
        """End it."""
        if self._process is not None:
            self._process.stop()
            self._process = None

    def _running(self) -> CameraProcess:
        assert self._process is not None, "started"  # noqa: S101  (SimulatedHill starts all before it does anything else)
        return self._process
