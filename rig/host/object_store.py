"""Object stores, and folders alike, through fsspec: whatever a store's package raises is an OSError here.

A store that accepts connections and never answers is given up after a minute.
"""

import socket
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib import import_module
from typing import Any, Final

from rig.errors import SvevError

Options = Mapping[str, str | bool | int]
#: Characters of a reason: some servers answer with a whole page.
_LONGEST: Final = 500
#: So long one try waits for a connection, and for the next bytes of an answer, s. A large object is put together by
#: the store before it answers.
_CONNECT_S: Final = 5
_ANSWER_S: Final = 15
#: Tries of botocore after errors of the server, and around them tries of s3fs after a body that broke off. Their own
#: numbers are 5 and 5: more than six minutes of silence.
_TRIES: Final = 2
_S3: Final = frozenset({"s3", "s3a"})


class StoreSilentError(OSError):
    """The store does not answer, whatever is asked of it."""


@contextmanager
def object_store(url: str, options: Options) -> Iterator[tuple[Any, str]]:
    """A store of fsspec, and the path in it; listings are asked anew each time.

    Args:
        url: an address, or a path.
        options: of the store's package.

    Raises:
        StoreSilentError: it does not answer in time.
        OSError: the package is missing, or something in the block failed: each package has errors of its own for
            a network or a server that fails, and few of these are OSErrors.
    """
    try:
        import fsspec  # noqa: PLC0415 - few rigs need it

        is_s3 = url.partition("://")[0] in _S3
        bounds = {"config_kwargs": _bounds()} if is_s3 else {}
        store, path = fsspec.core.url_to_fs(url, use_listings_cache=False, **options, **bounds)
        if is_s3:
            _bound(store)
        yield store, path
    except SvevError:
        raise
    except ImportError as error:
        raise OSError(f"{error}; install that package beside svev") from error
    except Exception as error:
        if "://" in url and _is_silence(error):
            where = options.get("endpoint_url")
            raise StoreSilentError(f"the object store{f' at {where}' if where else ''} does not answer") from error
        if isinstance(error, OSError):
            raise
        raise OSError(_first_line(error)) from error


def _bounds() -> dict[str, object]:
    """What botocore is to wait for at most."""
    return {
        "connect_timeout": _CONNECT_S,
        "read_timeout": _ANSWER_S,
        "retries": {"mode": "standard", "total_max_attempts": _TRIES},
        "connector_args": {"socket_factory": _socket},
    }


def _socket(address: tuple[Any, ...]) -> socket.socket:
    """A socket that fails when the other side takes nothing for a while: `read_timeout` counts from the last byte sent.

    Args:
        address: family, type, protocol and so on, as `socket.getaddrinfo` gives them.
    """
    made = socket.socket(*address[:3])
    made.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, 1000 * _ANSWER_S)
    return made


def _bound(store: Any) -> None:
    """Bound what s3fs and botocore offer no option for; both are installed by those who use such a store."""
    handlers = import_module("botocore.handlers")
    store.retries = _TRIES
    # With `Expect: 100-continue` what is written is held back until the store asks for it: for ever, if it does not.
    store.connect().meta.events.unregister("before-call.s3", handlers.add_expect_header)


def _is_silence(error: Exception) -> bool:
    """Whether a store did not answer in time: only some packages say so by a TimeoutError."""
    return any("Timeout" in each.__name__ for each in type(error).__mro__)


def why_not(error: OSError) -> str:
    """Why a store did not do something: one line."""
    return error.strerror or _first_line(error)


def _first_line(error: Exception) -> str:
    return str(error).strip().partition("\n")[0][:_LONGEST] or type(error).__name__
