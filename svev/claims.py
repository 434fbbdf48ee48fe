"""Claims what only one program can have: a folder to record into, and an address to listen on."""

import errno
import fcntl
import os
import re
import socket
import stat
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Final

from rig.errors import BadInputError
from rig.host.files import read_whole
from svev.neighbours import running_services

#: Name of the lock file in a folder of recordings.
LOCK: Final = ".svev.lock"
_FLAGS: Final = os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK
#: What file systems answer that cannot lock a folder: NFS wants it open for writing.
_NO_FOLDER_LOCKS: Final = frozenset({errno.EBADF, errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP, errno.EINVAL})


@contextmanager
def folder_claim(directory: Path, program: str, option: str) -> Iterator[None]:
    """Keep every other svev of this computer from recording into a directory, which is made if missing.

    The directory itself is locked, so that removing the lock file opens it to nobody; the file says who has locked it,
    and stands in for the directory on file systems that lock files only (NFS). When the process ends, the kernel
    unlocks both.

    Args:
        directory: for recordings.
        program: who claims it, e.g. "svev serve".
        option: by which another directory is chosen.

    Raises:
        BadInputError: another program has claimed it, or it cannot be made or written.
    """
    with ExitStack() as stack:
        try:
            directory.mkdir(parents=True, exist_ok=True)
            folder = os.open(directory, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
            stack.callback(os.close, folder)
            claimed = _lock(folder, _NO_FOLDER_LOCKS)
            file = _lock_file(folder, directory / LOCK) if claimed else None
        except (FileExistsError, NotADirectoryError):
            raise BadInputError(f"{directory}: is no folder; choose another {option}") from None
        except OSError as error:
            raise BadInputError(
                f"{directory}: cannot be written ({error.strerror}); choose another {option} or correct its permissions"
            ) from None
        if file is None:
            holder = _holder(directory / LOCK)
            instead = "record with it (svev ctl start)" if "svev serve" in holder else "end that one"
            raise BadInputError(f"{directory}: {holder} uses it: {instead}, or choose another {option}")
        stack.callback(os.close, file)
        with suppress(OSError):  # the disk is full: the next one is refused without the name of this one
            os.ftruncate(file, 0)
            os.pwrite(file, f"{os.getpid()} {program}\n".encode(), 0)
        yield  # the file stays: nobody waits for a disk that hangs, to remove it


@contextmanager
def folder_claims(directory: Path, fallback: Path | None, program: str, option: str) -> Iterator[None]:
    """As `folder_claim`, also of `recorder.fallback_directory`, in which a recording goes on whose disk fails.

    One that is not there, or cannot be written, is not claimed and not made: its disk may come later, and the doctor
    says that it is missing.

    Raises:
        BadInputError: another program has claimed one of them, or the first one cannot be made or written.
    """
    with ExitStack() as stack:
        stack.enter_context(folder_claim(directory, program, option))
        if fallback is not None and os.access(fallback, os.W_OK | os.X_OK) and not fallback.samefile(directory):
            stack.enter_context(folder_claim(fallback, program, "recorder.fallback_directory"))
        yield


def _lock(descriptor: int, unsupported: frozenset[int] = frozenset()) -> bool:
    """Lock a file or folder; False if somebody else has it. Where that is not supported, nobody has.

    Raises:
        OSError: it cannot be locked for another reason.
    """
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError as error:
        if error.errno not in unsupported:
            raise
    return True


def _lock_file(folder: int, path: Path) -> int | None:
    """The lock file of a folder, made if missing, locked; None if somebody else has locked it.

    Raises:
        BadInputError: something else than a file has its name.
        OSError: it cannot be made.
    """
    while True:
        try:
            file = os.open(LOCK, _FLAGS, 0o644, dir_fd=folder)
        except OSError as error:
            if error.errno == errno.ELOOP:
                raise BadInputError(f"{path}: is a link, and links are not followed: remove it") from None
            raise
        locked = False
        try:
            if not stat.S_ISREG(os.fstat(file).st_mode):
                raise BadInputError(f"{path}: is no regular file: remove it")
            if not _lock(file):
                return None
            # Somebody may have removed it in between, and a file without a name keeps nobody out.
            locked = _is_named(file, folder)
            if locked:
                return file
        finally:
            if not locked:
                os.close(file)


def _is_named(file: int, folder: int) -> bool:
    """Whether an open lock file is the one that has its name."""
    try:
        return os.path.samestat(os.fstat(file), os.stat(LOCK, dir_fd=folder, follow_symlinks=False))
    except FileNotFoundError:
        return False


def _holder(path: Path) -> str:
    """Who says in the lock file that he has locked the folder."""
    try:
        said = read_whole(path, 100, links=False).decode(errors="replace")
    except OSError:
        said = ""
    found = re.fullmatch(r"(\d{1,10}) (svev [a-z]{1,20})\n", said, re.ASCII)
    return f"another {found[2]} (process {found[1]})" if found else "another svev"


def listen(host: str, port: int) -> socket.socket:
    """Open a listening socket; connections wait until the server runs.

    Raises:
        BadInputError: the address is not of this machine, or is in use.
    """
    try:
        family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)[0]
        return socket.create_server((str(address[0]), port), family=family, backlog=128)
    except OSError as error:
        why = os.strerror(error.errno) if error.errno else error.strerror  # Python says the address once more
        for service in running_services() if error.errno == errno.EADDRINUSE else ():
            if service.port == str(port):
                raise BadInputError(
                    f"{host}:{port}: svev serve (process {service.pid}) runs there; operate it by {service.ctl}, or "
                    "choose another --port"
                ) from None
        raise BadInputError(
            f"{host}:{port} cannot be listened on ({why}): end the program that uses it, or choose another --port or "
            "--host"
        ) from None


def url(listener: socket.socket, scheme: str) -> str:
    """The address of the panel that this socket serves; `scheme` is http or https."""
    host, port = listener.getsockname()[:2]
    return f"{scheme}://[{host}]:{port}/" if ":" in host else f"{scheme}://{host}:{port}/"
