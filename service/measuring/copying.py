"""The program that copies a log and all that belongs to it elsewhere, started by `service.measuring.after_steps`."""

import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO, Final

from rig.api.measuring import MeasuringStep
from rig.background.program import Teller, serve
from rig.errors import StorageError
from rig.host.disk import ask_free_bytes, sync
from rig.host.files import open_to_read
from rig.phrase import phrase

_PIECE: Final = 1 << 22


def _copy(asked: dict[str, Any], tell: Teller) -> dict[str, Any]:
    """Copy the files and folders of `paths` into the folder `to`, each whole or absent; what is there already stays."""
    to = Path(asked["to"])
    if not to.is_dir():
        raise StorageError(
            phrase(
                "copying_no_folder",
                "{folder}: the folder for copies is not there; connect its disk, then measure again",
                folder=str(to),
            )
        )
    sources = [Path(each) for each in asked["paths"]]
    wanted = [source for source in sources if source.exists() and not _is_copied(source, to / source.name)]
    sizes = [sum(path.stat().st_size for path in _files(source)) for source in wanted]
    if ask_free_bytes(to) < sum(sizes):
        raise StorageError(
            phrase(
                "copying_no_room",
                "{folder}: has not the {gb:.1f} GB free that the copy takes; make room, then measure again",
                folder=str(to),
                gb=sum(sizes) / 1000000000.0,
            )
        )
    done, everything = 0, max(1, sum(sizes))
    for source in wanted:
        part = to / f".{source.name}.part"
        if part.is_dir():
            shutil.rmtree(part)
        for path in _files(source):
            target = part / path.relative_to(source) if source.is_dir() else part
            target.parent.mkdir(parents=True, exist_ok=True)
            with open_to_read(path, links=False) as reader, target.open("wb") as writer:
                for count in _pieces(reader, writer):
                    done += count
                    tell(step=MeasuringStep.COPYING, share=done / everything)
            shutil.copystat(path, target)
        if part.exists():
            _rename(part, to / source.name)
    sync(to)
    return {}


def _is_copied(source: Path, target: Path) -> bool:
    """Whether a log is there with the same size; results and notes are always copied anew.

    Raises:
        StorageError: another log of this name is there.
    """
    if source.suffix != ".mcap" or not target.exists():
        return False
    ours, there = source.stat(), target.stat()
    if ours.st_size != there.st_size:
        raise StorageError(
            phrase(
                "copying_other_log",
                "{path}: is another log of this name; move it away, then measure again",
                path=str(target),
            )
        )
    return True


def _files(source: Path) -> list[Path]:
    if not source.is_dir():
        return [source]
    return [path for path in sorted(source.rglob("*")) if path.is_file() and not path.is_symlink()]


def _pieces(reader: BinaryIO, writer: BinaryIO) -> Iterator[int]:
    """Copy until the end; yields the bytes of each piece."""
    while piece := reader.read(_PIECE):
        writer.write(piece)
        yield len(piece)
    writer.flush()
    os.fsync(writer.fileno())


def _rename(part: Path, target: Path) -> None:
    """Give what was copied its name, in place of what had it."""
    if target.is_dir():
        shutil.rmtree(target)
    part.replace(target)


if __name__ == "__main__":
    serve(_copy)
