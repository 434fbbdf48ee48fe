"""Keeps an operator's actions in a file to which lines are only added; none is lost once it was answered.

The file begins with a line that names format, recording and operator. Each further line is an entry: the marks that an
action set and the places that it cleared, or "undo", or "redo". What stands when the file is read is what the entries
make in their order. An entry is on the disk before its action is answered; one that a crash cut is no entry.
"""

import fcntl
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Final, Literal

import msgspec

from rig.api.digitizing import MarkSource, MarkState
from rig.errors import BadInputError, StorageError
from rig.host.disk import sync
from rig.phrase import phrase

FORMAT: Final = "svev-digitizing/1"
SUFFIX: Final = ".jsonl"


class Key(msgspec.Struct, frozen=True, array_like=True, order=True, gc=False):
    """Which thing in which image; `vertex` counts the points of a line and is -1 of everything else."""

    pulse: int
    camera: str
    thing: str
    vertex: int = -1


class Entered(msgspec.Struct, frozen=True, array_like=True, gc=False):
    """What was said of it: `xy` and `sigma` are px; `xy` is None where it cannot be measured."""

    state: MarkState = MarkState.MEASURED
    xy: tuple[float, float] | None = None
    sigma: tuple[float, float] | None = None
    source: MarkSource = MarkSource.HAND


class Entry(msgspec.Struct, frozen=True, omit_defaults=True):
    """One action: marks that it set, keys that it cleared; or that one was taken back, or done again."""

    do: Literal["change", "undo", "redo"] = "change"
    at: str = ""
    set: tuple[tuple[Key, Entered], ...] = ()
    clear: tuple[Key, ...] = ()


class _Head(msgspec.Struct, frozen=True):
    format: str
    recording: str
    operator: str


_HEAD: Final = msgspec.json.Decoder(_Head)
_ENTRY: Final = msgspec.json.Decoder(Entry)
_ENCODE: Final = msgspec.json.Encoder().encode


class Journal:
    """The file of one operator's actions. One program holds it at a time.

    Args:
        path: the file; made with the first entry if it is missing, with its folder.
        recording: id of the recording.
        operator: name.

    Raises:
        BadInputError: the file is another recording's, or no journal, or another program holds it.
        StorageError: it cannot be read.
    """

    def __init__(self, path: Path, recording: str, operator: str) -> None:
        self.path = path
        self._recording, self._operator = recording, operator
        self._whole = 0
        self._fd = -1
        self.entries: Sequence[Entry] = self._open() if path.exists() else ()

    def append(self, entry: Entry) -> None:
        """Put an entry on the disk.

        Raises:
            StorageError: the disk refuses; the entry is not kept.
            BadInputError: another program has begun to measure under this name.
        """
        if self._fd < 0 and self._open():
            self.close()
            raise BadInputError(
                phrase(
                    "hand_meanwhile",
                    "{path}: somebody has measured under this name meanwhile; open the page again",
                    path=str(self.path),
                )
            )
        line = _ENCODE(entry) + b"\n"
        try:
            written = os.pwrite(self._fd, line, self._whole)
            os.fdatasync(self._fd)
            trouble = None if written == len(line) else "the disk is full"
        except OSError as error:
            trouble = error.strerror
        if trouble is not None:
            self._cut()
            raise StorageError(
                phrase(
                    "hand_not_kept",
                    "{path}: {trouble}; the last action was not kept: make room",
                    path=str(self.path),
                    trouble=str(trouble),
                )
            )
        self._whole += len(line)

    def close(self) -> None:
        """Let other programs have the file."""
        if self._fd >= 0:
            os.close(self._fd)
            self._fd = -1

    def _open(self) -> Sequence[Entry]:
        """Open the file, and read its entries."""
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._fd = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW, 0o644)
        except OSError as error:
            raise StorageError(
                phrase(
                    "hand_folder",
                    "{path}: {trouble}; the marks cannot be kept: free the folder",
                    path=str(self.path),
                    trouble=str(error.strerror),
                )
            ) from None
        try:
            return self._begin()
        except BaseException:
            self.close()
            raise

    def _begin(self) -> Sequence[Entry]:
        try:
            fcntl.flock(self._fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise BadInputError(
                phrase(
                    "hand_held",
                    "{path}: another program measures under this name now; close it, or take another name",
                    path=str(self.path),
                )
            ) from None
        with os.fdopen(os.dup(self._fd), "rb") as file:
            text = file.read()
        if not text.strip(b"\n"):
            head = _ENCODE(_Head(FORMAT, self._recording, self._operator)) + b"\n"
            os.pwrite(self._fd, head, 0)
            os.fsync(self._fd)
            for folder in (self.path.parent, self.path.parent.parent):  # both may be new
                sync(folder)
            self._whole = len(head)
            return ()
        return self._read(text)

    def _read(self, text: bytes) -> Sequence[Entry]:
        """Whole entries; a last line that a crash cut is removed."""
        end = text.rfind(b"\n") + 1
        lines = text[:end].split(b"\n")[:-1]
        try:
            head = _HEAD.decode(lines[0] if lines else text)
            entries = [_ENTRY.decode(line) for line in lines[1:]]
        except msgspec.MsgspecError as error:
            raise BadInputError(
                phrase(
                    "hand_no_journal",
                    "{path}: is no journal of marks ({trouble}); move it away",
                    path=str(self.path),
                    trouble=str(error),
                )
            ) from None
        if head.format != FORMAT or head.recording != self._recording:
            raise BadInputError(
                phrase(
                    "hand_other_recording",
                    "{path}: belongs to recording {other} ({format}), not to {recording}; move it away",
                    path=str(self.path),
                    other=head.recording,
                    format=head.format,
                    recording=self._recording,
                )
            )
        self._whole = end
        self._cut()
        return entries

    def _cut(self) -> None:
        """Remove what stands after the last whole entry; if that fails, the next entry is written over it."""
        try:
            os.ftruncate(self._fd, self._whole)
        except OSError as error:
            raise StorageError(
                phrase(
                    "hand_cut",
                    "{path}: {trouble}; the marks cannot be kept",
                    path=str(self.path),
                    trouble=str(error.strerror),
                )
            ) from None


def operators(folder: Path) -> list[str]:
    """Who has measured: the names of the journals in a folder, in order."""
    if not folder.is_dir():
        return []
    return sorted(path.name.removesuffix(SUFFIX) for path in folder.iterdir() if path.name.endswith(SUFFIX))
