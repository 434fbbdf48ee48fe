"""Starts child processes in a few milliseconds: has a process of one thread that has imported their programs fork them.

Most of the time that a child takes to start goes into imports. The launcher is started once, imports what it is asked
to, and forks a child of itself for each launch. That child is handed over to the process that asked: it is an ordinary
child of it, with its exit code, its name in `ps` and its descriptors. Nothing with threads is ever forked
(docs/decisions/0003).
"""

import atexit
import ctypes
import json
import os
import select
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final, Protocol

import msgspec

_ROOT: Final = str(Path(__file__).resolve().parents[2])
_PROGRAM: Final = "rig.transport.launcher_program"
#: Room in the command line of the launcher for those of its children, which `ps` shows.
_ROOM: Final = " " * 200
_PR_SET_CHILD_SUBREAPER: Final = 36  # <linux/prctl.h>
_READ_ONCE: Final = ("LD_", "PYTHON", "OPENBLAS_", "OMP_", "GLIBC_", "MALLOC_", "GI_", "ARV_", "G_")
#: A launcher that takes longer than this to import and fork is taken for dead.
_ANSWER_S: Final = 20.0
_ANSWER_BYTES: Final = 64


class Launch(msgspec.Struct, frozen=True, tag=True):
    """What to start; its descriptors travel with it: standard output and error, then those in `numbers`.

    Attributes:
        module: to import; its `main` is run.
        command: the command line, as if it had been started by it.
        numbers: of the descriptors that the child inherits.
        own_group: whether it leads a process group of its own.
        launches: whether it will start programs: then it has a launcher from the beginning, forked with it.
        folder: its working directory.
        environment: its environment variables.
    """

    module: str
    command: tuple[str, ...]
    numbers: tuple[int, ...]
    own_group: bool
    launches: bool
    folder: str
    environment: dict[str, str]


class Import(msgspec.Struct, frozen=True, tag=True):
    """Modules to import in good time."""

    modules: tuple[str, ...]


class Process(Protocol):
    """A child process, as `subprocess.Popen` has it."""

    pid: int

    def poll(self) -> int | None:
        """Exit code, or minus the signal that ended it; None while it runs."""

    def wait(self, timeout: float | None = None) -> int:
        """Wait for the end."""

    def send_signal(self, sig: int) -> None:
        """Send a signal, unless the process has ended."""

    def kill(self) -> None:
        """End it."""


class Launched:
    """A child that the launcher forked for this process."""

    def __init__(self, pid: int) -> None:
        self.pid = pid
        try:
            self._fd = os.pidfd_open(pid)
        except OSError:  # no descriptor is left
            os.kill(pid, signal.SIGKILL)
            os.waitpid(pid, 0)
            raise
        self._code: int | None = None
        self._lock = threading.Lock()

    def poll(self) -> int | None:
        """Exit code, or minus the signal that ended it; None while it runs."""
        with self._lock:
            if self._code is None and (end := os.waitid(os.P_PIDFD, self._fd, os.WEXITED | os.WNOHANG)):
                self._code = end.si_status if end.si_code == os.CLD_EXITED else -end.si_status
                os.close(self._fd)
            return self._code

    def wait(self, timeout: float | None = None) -> int:
        """Wait for the end.

        Raises:
            subprocess.TimeoutExpired: it still runs after `timeout` seconds.
        """
        code = self.poll()
        if code is None:
            poll = select.poll()
            poll.register(self._fd, select.POLLIN)
            poll.poll(None if timeout is None else timeout * 1000)
            code = self.poll()
        if code is None:
            raise subprocess.TimeoutExpired([str(self.pid)], timeout or 0.0)
        return code

    def send_signal(self, sig: int) -> None:
        """Send a signal, unless the process has ended."""
        with self._lock:
            if self._code is None:
                with suppress(ProcessLookupError):
                    signal.pidfd_send_signal(self._fd, sig)

    def kill(self) -> None:
        """End it."""
        self.send_signal(signal.SIGKILL)


class Launcher:
    """The launcher process, as who asks sees it.

    Args:
        asking: our end of the connection to it.
        process: it.
    """

    def __init__(self, asking: socket.socket, process: Process) -> None:
        self._loaded_with = _read_once(program_environment())
        self._lock = threading.Lock()
        self._socket, self._process = asking, process
        self._socket.settimeout(_ANSWER_S)

    @classmethod
    def start(cls) -> "Launcher":
        """Start one by its command line."""
        ours, theirs = connection()
        with theirs:
            command = [*program_command(_PROGRAM), str(theirs.fileno()), _ROOM]
            descriptors = (theirs.fileno(),)
            return cls(
                ours,
                subprocess.Popen(command, stdin=subprocess.DEVNULL, pass_fds=descriptors, env=program_environment()),
            )

    @property
    def pid(self) -> int:
        """Its process id."""
        return self._process.pid

    @property
    def runs(self) -> bool:
        """Whether it can be asked."""
        return self._process.poll() is None

    def prepare(self, *modules: str) -> None:
        """Have modules imported in good time; returns at once."""
        with self._lock:
            self._send(Import(modules), ())

    def launch(self, launch: Launch, outputs: tuple[int, int]) -> Process | None:
        """Have a child forked.

        Args:
            launch: what to start.
            outputs: descriptors of its standard output and error.

        Returns:
            The child; None if it has to be started by its command line: the launcher has other variables for what is
            loaded, cannot import the module, or has ended.
        """
        if _read_once(launch.environment) != self._loaded_with:
            return None
        with self._lock, _adopting():
            answer = self._ask(launch, (*outputs, *launch.numbers))
        return Launched(int(answer)) if answer else None

    def end(self) -> None:
        """End it; the children that it forked go on."""
        self._socket.close()
        with suppress(subprocess.TimeoutExpired):  # it imports something endless: it ends after that
            self._process.wait(_ANSWER_S)

    def _send(self, request: Launch | Import, descriptors: tuple[int, ...]) -> None:
        with suppress(OSError):  # it has ended: what it should do is done otherwise, and the next call starts another
            # By Python's own module: it writes what no UTF-8 can hold, the bytes of a file's name for instance.
            data = json.dumps(msgspec.to_builtins(request)).encode("ascii")
            socket.send_fds(self._socket, [data], descriptors)

    def _ask(self, request: Launch, descriptors: tuple[int, ...]) -> bytes:
        """The number of the process that was launched; nothing if none was."""
        self._send(request, descriptors)
        try:
            return self._socket.recv(_ANSWER_BYTES)
        except OSError:  # dead, or so late that nobody can rely on it
            self._process.kill()
            return b""


def connection() -> tuple[socket.socket, socket.socket]:
    """The two ends of a connection between who asks and its launcher."""
    return socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)


@contextmanager
def _adopting() -> Iterator[None]:
    """Within, a process below this one whose parent ends becomes a child of ours, as what the launcher forks does."""
    prctl = ctypes.CDLL(None).prctl
    prctl(_PR_SET_CHILD_SUBREAPER, 1)
    try:
        yield
    finally:
        prctl(_PR_SET_CHILD_SUBREAPER, 0)


def program_command(module: str) -> tuple[str, ...]:
    """How a program of ours is started: the present folder is left out, where files of users may have our names."""
    return (sys.executable, "-P", "-m", module)


def program_environment() -> dict[str, str]:
    """The environment of a program of ours: the present one, and the same code as ours wherever we were started.

    An empty entry of PYTHONPATH, which means the present folder, is left out. Linear algebra runs on one thread: our
    matrices are small, programs share the processors, and the launcher must have one thread only.
    """
    path = os.pathsep.join([_ROOT, *filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep))])
    return {**os.environ, "PYTHONPATH": path, "OPENBLAS_NUM_THREADS": "1"}


def _read_once(environment: Mapping[str, str]) -> dict[str, str]:
    """Variables that the loader, the interpreter and libraries read when they start.

    OpenCV, when it is imported, names its own folder in LD_LIBRARY_PATH; that changes nothing for our programs.
    """
    read = {name: value for name, value in environment.items() if name.startswith(_READ_ONCE)}
    return read | {"LD_LIBRARY_PATH": ""}


_the_lock: Final = threading.Lock()
_the_launcher: Launcher | None = None


def launcher() -> Launcher:
    """The launcher of this process; started when it is first needed, and again if it has ended."""
    global _the_launcher  # noqa: PLW0603 - one for the process, as its environment is
    with _the_lock:
        if _the_launcher is None:
            atexit.register(end_launcher)
        elif not _the_launcher.runs:
            _the_launcher.end()
            _the_launcher = None
        _the_launcher = _the_launcher or Launcher.start()
        return _the_launcher


def take_over(forked: Launcher) -> None:
    """Have a launcher that was forked with this process, before anything was asked of one."""
    global _the_launcher  # noqa: PLW0603 - see above
    with _the_lock:
        atexit.register(end_launcher)
        _the_launcher = forked


def end_launcher() -> None:
    """End the launcher, if there is one."""
    global _the_launcher  # noqa: PLW0603 - see above
    with _the_lock:
        if _the_launcher is not None:
            _the_launcher.end()
        _the_launcher = None


def start_program(
    module: str,
    arguments: tuple[str, ...],
    inherit: tuple[int, ...],
    more: Mapping[str, str],
    *,
    own_group: bool,
    output: int | tuple[int, int] | None,
    launches: bool = False,
) -> Process:
    """Start a program, a module with a function `main`: `python -m MODULE ARGUMENTS`.

    Args:
        module: its module.
        arguments: its command line.
        inherit: descriptors that it has under the same numbers.
        more: variables that it has beside ours.
        own_group: put it into a process group of its own.
        output: descriptor of its standard output and error, or those of both; None: ours.
        launches: it will start programs itself, soon after its start.
    """
    command, environment = (*program_command(module), *arguments), {**program_environment(), **more}
    launch = Launch(module, command, inherit, own_group, launches, str(Path.cwd()), environment)
    out, err = output if isinstance(output, tuple) else (output, output)
    return launcher().launch(launch, (1 if out is None else out, 2 if err is None else err)) or subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=out,
        stderr=err,
        pass_fds=inherit,
        env=environment,
        process_group=0 if own_group else None,
    )
