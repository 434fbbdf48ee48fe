"""Faults of the disk for programs under test: their calls that write to logs fail, hang or are slow, as a test says.

A small library (`faulty_disk.c`), preloaded into the program, stands between it and the system calls. Everything else
is real: the program, its threads, its files.
"""

import errno
import mmap
import struct
from collections.abc import Mapping
from enum import IntFlag
from pathlib import Path
from typing import Final

from tests.support.preloaded import compiled, preloading

_SOURCE: Final = Path(__file__).with_suffix(".c")
#: As `struct faults` in the library: calls, error, least, most, hang, rate, skip, hit, only.
_FAULTS: Final = struct.Struct("=Ii6Q256s")
_MOST: Final = (1 << 64) - 1
#: Writes up to this size are of events and health records, larger ones of triplets.
SMALL: Final = 64 * 1024


class Call(IntFlag):
    """System calls that a fault hits."""

    WRITE = 1
    SYNC = 2
    CUT = 4
    OPEN = 8
    ALL = 15


class FaultyDisk:
    """One disk with faults; without one at first.

    Args:
        folder: for the library and the file that says what happens; not the folder of the logs.
    """

    def __init__(self, folder: Path) -> None:
        self._library, control = compiled(_SOURCE, folder), folder / "faulty_disk.control"
        control.write_bytes(bytes(mmap.PAGESIZE))
        self._control = control
        with control.open("r+b") as file:
            self._shared = mmap.mmap(file.fileno(), mmap.PAGESIZE)

    @property
    def environment(self) -> Mapping[str, str]:
        """Variables of the environment that put the library into a program and its children."""
        return {**preloading(self._library), "SVEV_TEST_DISK": str(self._control)}

    @property
    def hits(self) -> int:
        """How many calls a fault has hit."""
        return int(_FAULTS.unpack_from(self._shared)[-2])

    def heal(self) -> None:
        """Let everything work again."""
        self._set(Call(0), 0)

    def fail(
        self,
        error: int = errno.EIO,
        calls: Call = Call.WRITE,
        *,
        least: int = 0,
        most: int = _MOST,
        only: Path | None = None,
    ) -> None:
        """Let calls fail.

        Args:
            error: the error number that they give.
            calls: which calls.
            least: only writes of at least so many bytes.
            most: only writes of at most so many bytes.
            only: only files in this folder; None: all logs.
        """
        self._set(calls, error, least=least, most=most, only=only)

    def hang(self, calls: Call = Call.WRITE | Call.SYNC, *, only: Path | None = None) -> None:
        """Let calls hang until `heal`; `only` as for `fail`."""
        self._set(calls, 0, hang=1, only=only)

    def slow(self, bytes_per_s: int) -> None:
        """Let writes take as long as on a disk that takes so many bytes per second."""
        self._set(Call(0), 0, rate=bytes_per_s)

    def close(self) -> None:
        """Let everything go on, and give up the shared memory."""
        self.heal()
        self._shared.close()

    def _set(
        self,
        calls: Call,
        error: int,
        *,
        least: int = 0,
        most: int = _MOST,
        hang: int = 0,
        rate: int = 0,
        only: Path | None = None,
    ) -> None:
        prefix = b"" if only is None else f"{only}/".encode()
        # `calls` is written last when a fault begins: the library reads the other fields only then.
        _FAULTS.pack_into(self._shared, 0, 0, error, least, most, hang, rate, 0, self.hits, prefix)
        struct.pack_into("=I", self._shared, 0, int(calls))
