"""UDP sockets of the camera."""

import errno
import socket

from rig.errors import BadInputError

#: Errors of sending that mean that nobody listens, not that the camera is broken: a real one would not even notice.
NOBODY_LISTENS = frozenset(
    {errno.ECONNREFUSED, errno.ENETUNREACH, errno.EHOSTUNREACH, errno.EMSGSIZE, errno.EPERM, errno.EINVAL}
)


def bound(address: str, port: int = 0, *, shared: bool = False) -> socket.socket:
    """A UDP socket bound to `address`.

    Args:
        address: IPv4 address.
        port: 0: any free one.
        shared: whether several sockets may be bound there (broadcast addresses).

    Raises:
        BadInputError: the address is in use or none of this machine's.
    """
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        if shared:
            made.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        made.bind((address, port))
    except OSError as error:
        made.close()
        raise BadInputError(_in_words(f"{address}:{port}", error)) from None
    return made


def _in_words(place: str, error: OSError) -> str:
    match error.errno:
        case errno.EADDRINUSE:
            return f"address {place} is in use by another program: stop it or choose another address"
        case errno.EADDRNOTAVAIL:
            return f"address {place} is none of this machine's: choose another, e.g. 127.0.0.11"
        case _:
            return f"address {place} cannot be bound ({error.strerror}): choose another address"
