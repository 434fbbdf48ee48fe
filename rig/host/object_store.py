"""Object stores, and folders alike, through fsspec: whatever a store's package raises is an OSError here."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Final

from rig.errors import SvevError

Options = Mapping[str, str | bool | int]
#: Characters of a reason: some servers answer with a whole page.
_LONGEST: Final = 500


@contextmanager
def object_store(url: str, options: Options) -> Iterator[tuple[Any, str]]:
    """A store of fsspec, and the path in it; listings are asked anew each time.

    Args:
        url: an address, or a path.
        options: of the store's package.

    Raises:
        OSError: the package is missing, or something in the block failed: each package has errors of its own for
            a network or a server that fails, and few of these are OSErrors.
    """
    try:
        import fsspec  # noqa: PLC0415 - few rigs need it

        store, path = fsspec.core.url_to_fs(url, use_listings_cache=False, **options)
        yield store, path
    except (OSError, SvevError):
        raise
    except ImportError as error:
        raise OSError(f"{error}; install that package beside svev") from error
    except Exception as error:
        raise OSError(_first_line(error)) from error


def why_not(error: OSError) -> str:
    """Why a store did not do something: one line."""
    return error.strerror or _first_line(error)


def _first_line(error: Exception) -> str:
    return str(error).strip().partition("\n")[0][:_LONGEST] or type(error).__name__
