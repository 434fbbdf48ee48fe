"""Claims what only one running service can have: a folder of recordings, and an address to listen on."""

import errno
import fcntl
import os
import socket
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rig.errors import BadInputError


@contextmanager
def data_lock(directory: Path) -> Iterator[None]:
    """Lock a directory for recordings, and make it if missing. When the process ends, the kernel unlocks it.

    Raises:
        BadInputError: another service has locked it, or it cannot be made or written.
    """
    path = directory / ".svev.lock"
    try:
        directory.mkdir(parents=True, exist_ok=True)
        file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK, 0o644)
        if not stat.S_ISREG(os.fstat(file).st_mode):
            os.close(file)
            raise BadInputError(f"{path}: is no regular file: remove it")
    except OSError as error:
        if error.errno == errno.ELOOP:
            raise BadInputError(f"{path}: is a link, and links are not followed: remove it") from None
        raise BadInputError(
            f"{directory}: cannot be written ({error.strerror}); choose another --data or correct its permissions"
        ) from None
    try:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = os.pread(file, 20, 0).decode(errors="replace").strip() or "unknown"
            raise BadInputError(
                f"{directory}: another svev serve (process {holder}) uses it: end that one, or choose another --data"
            ) from None
        os.ftruncate(file, 0)
        os.pwrite(file, f"{os.getpid()}\n".encode(), 0)
        yield
    finally:
        os.close(file)


def listen(host: str, port: int) -> socket.socket:
    """Open a listening socket; connections wait until the server runs.

    Raises:
        BadInputError: the address is not of this machine, or is in use.
    """
    try:
        family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)[0]
        return socket.create_server((str(address[0]), port), family=family, backlog=128)
    except OSError as error:
        raise BadInputError(
            f"{host}:{port} cannot be listened on ({error.strerror}): end the program that uses it (another svev "
            "serve?), or choose another --port or --host"
        ) from None


def url(listener: socket.socket, scheme: str) -> str:
    """The address of the panel that this socket serves; `scheme` is http or https."""
    host, port = listener.getsockname()[:2]
    return f"{scheme}://[{host}]:{port}/" if ":" in host else f"{scheme}://{host}:{port}/"
