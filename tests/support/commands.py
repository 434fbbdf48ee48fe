"""Commands of `svev` as processes of their own, forked by the launcher of this worker instead of started anew."""

import os
import subprocess
import tempfile
from collections.abc import Mapping
from types import TracebackType
from typing import BinaryIO, Self

from rig.transport.launcher import Process, launcher, start_program
from service.processes.backends import programs_of
from svev.cli import _COMMANDS

#: What commands import when they have begun, beside their own module.
_IMPORTING = {
    "calibrate": ("svev.commands.networks.calibrate_pictures",),
    "ctl": ("httpx",),
    "digitize": ("analysis.digitizing.desk",),
}
#: Commands that start programs.
_LAUNCHING = ("record", "serve", "rehearse", "demo", "bench")
#: What their processes run.
_OF_RIGS = programs_of(("aravis", "iidc", "sim", "replay"), simulated=True)
_ENDS_S = 10.0


class Command:
    """A command that runs; to be used like a `subprocess.Popen` whose two outputs are texts."""

    def __init__(self, process: Process, out: BinaryIO, err: BinaryIO) -> None:
        self._process, self._out, self._err = process, out, err

    @property
    def pid(self) -> int:
        """Its process id."""
        return self._process.pid

    @property
    def returncode(self) -> int | None:
        """Its exit code; None while it runs."""
        return self._process.poll()

    def poll(self) -> int | None:
        """Its exit code; None while it runs."""
        return self._process.poll()

    def wait(self, timeout: float | None = None) -> int:
        """Wait for its end."""
        return self._process.wait(timeout)

    def send_signal(self, number: int) -> None:
        """Send it a signal."""
        self._process.send_signal(number)

    def kill(self) -> None:
        """End it."""
        self._process.kill()

    def written(self) -> tuple[str, str]:
        """What it has written until now to standard output and error."""
        return _text(self._out), _text(self._err)

    def communicate(self, timeout: float | None = None) -> tuple[str, str]:
        """Wait for its end.

        Returns:
            What it has written to standard output and error.
        """
        self._process.wait(timeout)
        written = self.written()
        self.close()
        return written

    def close(self) -> None:
        """Close the files of its outputs."""
        self._out.close()
        self._err.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End it, if it still runs."""
        if self._process.poll() is None:
            self._process.kill()
            self._process.wait(_ENDS_S)
        self.close()


def launch_svev(
    *arguments: str, output: int | tuple[int, int], environment: Mapping[str, str] | None = None
) -> Process:
    """Start `svev ARGUMENTS`.

    Args:
        arguments: its command line.
        output: descriptor of its standard output and error, or those of both.
        environment: variables that it has beside ours.
    """
    command = arguments[0] if arguments else ""
    if command in _COMMANDS:  # once: the next one has it from its birth, and so has the launcher of a service
        programs = _OF_RIGS if command in _LAUNCHING else _IMPORTING.get(command, ())
        launcher().prepare(f"svev.commands.{_COMMANDS[command][0]}", *programs)
    return start_program(
        "svev.__main__",
        arguments,
        (),
        environment or {},
        own_group=False,
        output=output,
        launches=command in _LAUNCHING,
    )


def start_svev(*arguments: str, environment: Mapping[str, str] | None = None) -> Command:
    """Start `svev ARGUMENTS`, with variables that it has beside ours; its outputs go to files."""
    out, err = tempfile.TemporaryFile(), tempfile.TemporaryFile()  # noqa: SIM115 - the command closes them
    process = launch_svev(*arguments, output=(out.fileno(), err.fileno()), environment=environment)
    return Command(process, out, err)


def run_svev(
    *arguments: str, timeout_s: float = 60, environment: Mapping[str, str] | None = None
) -> "subprocess.CompletedProcess[str]":
    """Run `svev ARGUMENTS` and take what it writes."""
    with start_svev(*arguments, environment=environment) as command:
        code = command.wait(timeout_s)
        return subprocess.CompletedProcess(arguments, code, *command.written())


def _text(file: BinaryIO) -> str:
    return os.pread(file.fileno(), os.fstat(file.fileno()).st_size, 0).decode()
