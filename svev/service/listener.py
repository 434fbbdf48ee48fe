"""The socket of the API, bound before anything is started."""

import socket

from rig.errors import BadInputError


def listen(host: str, port: int) -> socket.socket:
    """Bind; connections wait until the server runs.

    Raises:
        BadInputError: the address is none of this machine's, or in use.
    """
    try:
        family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)[0]
        return socket.create_server((str(address[0]), port), family=family, backlog=128)
    except OSError as error:
        raise BadInputError(
            f"{host}:{port} cannot be listened on ({error.strerror}): end the program that uses it (another svev "
            "serve?), or choose another --port or --host"
        ) from None


def url(listener: socket.socket) -> str:
    """The address of the panel."""
    host, port = listener.getsockname()[:2]
    return f"http://[{host}]:{port}/" if ":" in host else f"http://{host}:{port}/"
