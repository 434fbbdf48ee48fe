"""The program of the launcher: imports modules and forks children that run them. It never has a second thread."""

import atexit
import ctypes
import gc
import importlib
import json
import os
import socket
import sys
import threading
from contextlib import suppress
from pathlib import Path
from typing import Final, NoReturn

import msgspec

from rig.host.endings import heed_signals_again, leave_signals_to_parent
from rig.transport.launcher import Import, Launch, Launched, Launcher, connection, take_over

_REQUEST_BYTES: Final = 1 << 16
_MOST_DESCRIPTORS: Final = 253  # SCM_MAX_FD of the kernel
#: Fields of /proc/PID/stat (proc(5)), counted from the one after the program's name.
_ARG_START, _ARG_END = 45, 46
#: Python's exit code where standard output or error cannot be written at the end.
_NOT_WRITTEN: Final = 120


def main() -> None:
    """Serve until the process that asks is gone; in each child: run its program."""
    asking: socket.socket | None = socket.socket(fileno=int(sys.argv[1]))
    command, launch = tuple(sys.orig_argv[:-1]), None
    while asking is not None:
        leave_signals_to_parent()
        _show_as(command)
        with asking:
            launch = _serve(asking)
        asking = _fork_launcher(launch) if launch is not None and launch.launches else None
    if launch is not None:
        _run(launch.module)
    os._exit(0)


def _run(module: str) -> NoReturn:
    """Run a program to its end, but leave its memory to the kernel.

    Python would take apart every module on the way out, and so copy all that this process shares with the launcher.
    What has to be done at the end is done: threads are awaited, what was registered is called, outputs are written.
    """
    try:
        code = importlib.import_module(module).main()
    except SystemExit as end:
        code = end.code
    if code is not None and not isinstance(code, int):
        sys.stderr.write(f"{code}\n")
        code = 1
    threading._shutdown()  # type: ignore[attr-defined] # as multiprocessing does at the end of a fork
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:
            try:
                stream.flush()
            except (OSError, ValueError):  # nobody takes it, or it is closed
                code = code or _NOT_WRITTEN
    os._exit((code or 0) & 0xFF)


def _fork_launcher(launch: Launch) -> socket.socket | None:
    """Fork a launcher for the program that this process is about to run.

    Returns:
        In the launcher: its end of the connection to the program; in the program nothing.
    """
    ours, theirs = connection()
    if (pid := os.fork()) != 0:
        theirs.close()
        take_over(Launcher(ours, Launched(pid)))
        return None
    ours.close()
    for descriptor in launch.numbers:
        os.close(descriptor)
    return theirs


def _serve(asking: socket.socket) -> Launch | None:
    """Do what is asked; returns None at the end, and in each child what it shall run."""
    while True:
        data, descriptors, _, _ = socket.recv_fds(asking, _REQUEST_BYTES, _MOST_DESCRIPTORS)
        if not data:
            return None
        match msgspec.convert(json.loads(data), Launch | Import):
            case Import(modules):
                for module in modules:
                    _load(module)
            case Launch() as launch:
                pid = None
                if _load(launch.module):
                    with suppress(OSError):  # of files or processes: whoever starts it otherwise sees the same error
                        pid = _fork_for_who_asks(own_group=launch.own_group)
                if pid == 0:
                    asking.close()  # its number may be one of those that the program has
                    _become(launch, descriptors)
                    return launch
                for descriptor in descriptors:
                    os.close(descriptor)
                with suppress(OSError):  # who asked is gone: the next turn sees it
                    asking.send(str(pid or "").encode())


def _load(module: str) -> bool:
    """Import a module; whether children may be forked that run it."""
    if module not in sys.modules:
        try:
            importlib.import_module(module)
        except Exception:  # noqa: BLE001 - whoever starts it otherwise sees the same error in its own output
            return False
        gc.collect()
        gc.freeze()  # what is there now is shared with the children, as long as nobody writes to it
    return len(list(Path("/proc/self/task").iterdir())) == 1


def _fork_for_who_asks(*, own_group: bool) -> int:
    """Fork a child whose parent is not we, but who asked: a child of a child that ends at once.

    Returns:
        Its number; 0 in the child itself, once it has its new parent.
    """
    told, tell = os.pipe()
    wait, go = os.pipe()
    if (between := os.fork()) == 0:
        if (child := os.fork()) != 0:
            if own_group:
                os.setpgid(child, child)
            os.write(tell, str(child).encode())
            os._exit(0)
        for descriptor in (told, tell, go):
            os.close(descriptor)
        os.read(wait, 1)
        os.close(wait)
        return 0
    for descriptor in (tell, wait):
        os.close(descriptor)
    os.waitpid(between, 0)
    pid = int(os.read(told, 32))
    for descriptor in (told, go):
        os.close(descriptor)
    return pid


def _become(launch: Launch, descriptors: list[int]) -> None:
    """Have the place, the descriptors and the name that a program has which was started by its command line."""
    heed_signals_again()
    numbers = (1, 2, *launch.numbers)
    moved = list(descriptors)
    for place in range(len(moved)):
        while moved[place] in numbers:  # it stands where another one belongs
            moved[place] = os.dup(moved[place])
    others = set(range(3, max(*descriptors, *moved) + 1)) - set(numbers)
    for descriptor, number in zip(moved, numbers, strict=True):
        os.dup2(descriptor, number)
    for descriptor in others:
        with suppress(OSError):  # nothing is open there
            os.close(descriptor)
    os.chdir(launch.folder)
    os.environ.clear()
    os.environ.update(launch.environment)
    sys.argv = [sys.argv[0], *launch.command[4:]]
    sys.orig_argv = list(launch.command)
    _show_as(launch.command)


def _show_as(command: tuple[str, ...]) -> None:
    """Let `ps` show this command line. It has the room of the one that the launcher was started with."""
    fields = Path("/proc/self/stat").read_text().rpartition(")")[2].split()
    start, end = int(fields[_ARG_START]), int(fields[_ARG_END])
    text = b"".join(os.fsencode(word) + b"\0" for word in command)[: end - start - 1]
    if start:
        ctypes.memmove(start, text.ljust(end - start, b"\0"), end - start)


if __name__ == "__main__":
    main()
