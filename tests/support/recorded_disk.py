"""What a program did to the files of one folder, call by call, and what a power cut at any moment may leave of it.

A small library (`recorded_disk.c`), preloaded into the program and its children, notes each call. Out of its notes the
folder is built anew as it was seen at a moment, or as a disk may hold it after the power went: what was not made
durable may be lost, in part too, and later writes may be there although earlier ones are not.
"""

import os
import random
import struct
import subprocess
from bisect import bisect_right
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum
from pathlib import Path
from typing import Final

_SOURCE: Final = Path(__file__).with_suffix(".c")
#: As `struct entry` in the library.
_ENTRY: Final = struct.Struct("=QQqQQIIII")
#: A disk writes so many bytes whole or not at all.
_SECTOR: Final = 512


class What(IntEnum):
    """What a call did."""

    CREATE = 1  #: made a file; without a path it has no name yet
    WRITE = 2
    CUT = 3  #: gave a file another length
    SYNC = 4  #: made durable what was done to a file, or to the names in a folder
    RENAME = 5
    NAME = 6  #: gave a file one more name
    REMOVE = 7  #: removed a name
    FOLDER = 8  #: made a folder


_OF_NAMES: Final = {What.CREATE, What.RENAME, What.NAME, What.REMOVE, What.FOLDER}


@dataclass(frozen=True, slots=True)
class Call:
    """A call that has ended.

    Attributes:
        begin, end: its place among the beginnings and ends of all calls.
        time_ns: when it ended, on the monotonic clock.
        what: what it did.
        file: number of the file or folder, never used again.
        offset: first byte of a write, or new length.
        path, new: name, relative to the folder, and new name.
        data: what was written.
    """

    begin: int
    end: int
    time_ns: int
    what: What
    file: int
    offset: int
    path: str
    new: str
    data: bytes


class RecordedDisk:
    """Records what programs do to the files of a folder.

    Args:
        folder: for the library and its notes.
        root: the folder; of files that are in it already nothing is known.
    """

    def __init__(self, folder: Path, root: Path) -> None:
        self._root, self._notes, self._counter = root, folder / "recorded_disk.notes", folder / "recorded_disk.count"
        self._library = folder / "recorded_disk.so"
        options = ["-shared", "-fPIC", "-O1", "-Wall", "-Wextra", "-Werror"]
        command = ["gcc", *options, str(_SOURCE), "-o", str(self._library)]
        subprocess.run(command, check=True, timeout=60)
        self._counter.write_bytes(bytes(8))
        there = (path for path in (root, *root.rglob("*")) if path.is_dir())
        self._folders = {self._relative(str(path)): path.stat().st_ino for path in there}

    @property
    def environment(self) -> Mapping[str, str]:
        """Variables of the environment that put the library into a program and its children."""
        return {
            "LD_PRELOAD": " ".join([str(self._library), *filter(None, [os.environ.get("LD_PRELOAD")])]),
            "SVEV_TEST_ROOT": str(self._root),
            "SVEV_TEST_NOTES": str(self._notes),
            "SVEV_TEST_COUNTER": str(self._counter),
        }

    def history(self) -> "History":
        """All calls until now."""
        notes, place, found = self._notes.read_bytes(), 0, []
        while place < len(notes):
            begin, end, time_ns, inode, offset, what, first, second, length = _ENTRY.unpack_from(notes, place)
            place += _ENTRY.size
            names = [notes[place : place + first], notes[place + first : place + first + second]]
            place += first + second
            path, new = (self._relative(os.fsdecode(name)) for name in names)
            data = notes[place : place + length]
            place += length
            found.append(Call(begin, end, time_ns, What(what), inode, offset, path, new, data))
        numbers = {inode: -2 - place for place, inode in enumerate(self._folders.values())}
        folders = {name: numbers[inode] for name, inode in self._folders.items()}
        return History(_numbered(sorted(found, key=lambda call: call.end), numbers), folders)

    def _relative(self, path: str) -> str:
        return os.path.relpath(path, self._root) if path else ""


def _numbered(calls: Iterable[Call], numbers: dict[int, int]) -> list[Call]:
    """The calls with a number for each file and folder: the file system uses those of removed ones again."""
    following, found = 1, []
    for call in calls:
        if call.what in (What.CREATE, What.FOLDER):
            numbers[call.file], following = following, following + 1
        found.append(replace(call, file=numbers.get(call.file, -1)))
    return found


@dataclass(slots=True)
class Names:
    """The names in a folder and those below it, and the files and folders that have them."""

    files: dict[str, int] = field(default_factory=dict)
    folders: dict[str, int] = field(default_factory=dict)

    def apply(self, call: Call) -> None:
        """Do what a call did."""
        match call.what:
            case What.CREATE | What.NAME if call.path:
                self.files[call.path] = call.file
            case What.FOLDER:
                self.folders[call.path] = call.file
            case What.REMOVE:
                self.files.pop(call.path, None)
                self.folders.pop(call.path, None)
            case What.RENAME:
                self._rename(call.path, call.new)

    def files_of(self, file: int) -> list[str]:
        """The names of a file."""
        return [name for name, other in self.files.items() if other == file]

    def _rename(self, before: str, after: str) -> None:
        for names in (self.files, self.folders):
            for name in [name for name in names if name == before or name.startswith(f"{before}/")]:
                number = names.pop(name)
                if not after.startswith(".."):
                    names[after + name.removeprefix(before)] = number


class History:
    """All calls of programs that changed a folder.

    Args:
        calls: in the order in which they ended.
        folders: numbers of those that were there before, by their names.

    Attributes:
        calls: in the order in which they ended.
    """

    def __init__(self, calls: Sequence[Call], folders: Mapping[str, int]) -> None:
        self.calls, self._folders = calls, folders
        self._ends = [call.end for call in calls]
        self._times = [call.time_ns for call in calls]
        self._of_names = [call for call in calls if call.what in _OF_NAMES]
        self._of_files: dict[int, list[Call]] = defaultdict(list)
        self._syncs: dict[int, list[Call]] = defaultdict(list)
        for call in calls:
            if call.what in (What.WRITE, What.CUT):
                self._of_files[call.file].append(call)
            elif call.what is What.SYNC:
                self._syncs[call.file].append(call)

    def at(self, time_ns: int) -> int:
        """The end of the last call that had ended at a time."""
        place = bisect_right(self._times, time_ns)
        return self.calls[place - 1].end if place else -1

    def written_ns(self, name: str, begin: int, end: int) -> int:
        """When the bytes of a file from `begin` to `end` had all been written; the file has this name in the end."""
        file = self._names(self.calls[-1].end).files[name]
        return max(
            call.time_ns
            for call in self._of_files[file]
            if call.what is What.WRITE and call.offset < end and begin < call.offset + len(call.data)
        )

    def seen(self, end: int) -> dict[str, bytes]:
        """The files as programs saw them when the call had ended that ends here: their contents by name."""
        return {name: self._content(file, end) for name, file in self._names(end).files.items()}

    def versions(self, begin: int, end: int, wanted: Callable[[str], bool]) -> dict[str, set[bytes | None]]:
        """The contents that files had between two places, None for none, by their names.

        Args:
            begin: the earlier place.
            end: the later one.
            wanted: asked whether a name matters.
        """
        names = self._names(begin)
        contents = {file: bytearray(self._content(file, begin)) for name, file in names.files.items() if wanted(name)}
        found: dict[str, set[bytes | None]] = {
            name: {bytes(contents[file])} for name, file in names.files.items() if wanted(name)
        }

        def look(name: str, place: int) -> None:
            if name and wanted(name):
                file = names.files.get(name)
                if file is not None and file not in contents:
                    contents[file] = bytearray(self._content(file, place))
                now = None if file is None else bytes(contents[file])
                found.setdefault(name, {None}).add(now)

        for call in self.calls[bisect_right(self._ends, begin) : bisect_right(self._ends, end)]:
            if call.what in _OF_NAMES:
                before = {*names.files}
                names.apply(call)
                for name in {call.path, call.new, *(before ^ {*names.files})}:
                    look(name, call.end)
            elif call.what is not What.SYNC:
                if call.file in contents:
                    _apply(call, contents[call.file])
                for name in names.files_of(call.file):
                    look(name, call.end)
        return found

    def _names(self, end: int) -> Names:
        names = Names(folders=dict(self._folders))
        for call in self._of_names:
            if call.end <= end:
                names.apply(call)
        return names

    def after_cut(self, end: int, draw: random.Random) -> dict[str, bytes]:
        """The files that a disk may hold if the power goes when the call has ended that ends here.

        Names change in the order in which programs changed them, as with any file system that keeps a journal: of the
        last changes some may be missing. Of the data of a file that is not durable everything, nothing or any part may
        be there, in sectors.
        """
        names = Names(folders=dict(self._folders))
        changes = [call for call in self._of_names if call.begin <= end]
        certain = self._certain_names(changes, end)
        for call in changes[: draw.randint(certain, len(changes))]:
            names.apply(call)
        share = draw.choice((0.0, 1.0, draw.random()))
        return {name: self._left(file, end, share, draw) for name, file in names.files.items()}

    def _certain_names(self, changes: Sequence[Call], end: int) -> int:
        """How many of the changes of names are durable."""
        durable = 0
        names = Names(folders=dict(self._folders))
        for place, call in enumerate(changes, 1):
            paths = [str(Path(path).parent) for path in (call.path, call.new) if path]
            folders = [names.folders.get(path, -1) for path in paths]
            if any(self._is_durable(folder, call, end) for folder in folders):
                durable = place
            names.apply(call)
        return durable

    def _is_durable(self, file: int, call: Call, end: int) -> bool:
        return any(call.end < sync.begin and sync.end <= end for sync in self._syncs[file])

    def _content(self, file: int, end: int) -> bytes:
        content = bytearray()
        for call in self._of_files[file]:
            if call.end > end:
                break
            _apply(call, content)
        return bytes(content)

    def _left(self, file: int, end: int, share: float, draw: random.Random) -> bytes:
        """What is left of a file if each change that is not durable has come to the disk with a likelihood."""
        content = bytearray()
        durable = max((sync.begin for sync in self._syncs[file] if sync.end <= end), default=-1)
        for call in self._of_files[file]:
            if call.begin > end:
                continue
            if call.end < durable:
                _apply(call, content)
            elif call.what is What.CUT:
                if draw.random() < share:
                    _apply(call, content)
            else:
                _apply_sectors(call, content, share, draw)
        return bytes(content)


def _apply(call: Call, content: bytearray) -> None:
    if call.what is What.CUT:
        del content[call.offset :]
        content.extend(bytes(call.offset - len(content)))
        return
    content.extend(bytes(max(0, call.offset - len(content))))
    content[call.offset : call.offset + len(call.data)] = call.data


def _apply_sectors(call: Call, content: bytearray, share: float, draw: random.Random) -> None:
    """Write each sector of a write, or not."""
    if share in (0.0, 1.0):
        if share:
            _apply(call, content)
        return
    place, end = call.offset, call.offset + len(call.data)
    while place < end:
        following = min(end, (place // _SECTOR + 1) * _SECTOR)
        if draw.random() < share:
            content.extend(bytes(max(0, place - len(content))))
            content[place:following] = call.data[place - call.offset : following - call.offset]
        place = following


def lay_out(files: Mapping[str, bytes], folder: Path) -> None:
    """Write files below a folder."""
    folder.mkdir()
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
