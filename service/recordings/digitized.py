"""What people measured in a log by hand, to take away with it."""

import io
from pathlib import Path
from typing import BinaryIO

from recorder.log.digitized_path import digitized_path
from rig.host.files import open_to_read
from service.measuring.results import file_download
from service.seam.archive import Download


def digitized_downloads(log: Path, name: str) -> list[Download]:
    """The marks of all operators, and the jumps computed from them, in a folder that belongs beside the log's file.

    Args:
        log: the log.
        name: of the file that it is taken away as.
    """
    folder = digitized_path(log)
    within = digitized_path(Path(name)).name
    files = [path for path in sorted(folder.rglob("*")) if path.is_file() and not path.is_symlink()]
    seen = [path for path in files if not any(part.startswith(".") for part in path.relative_to(folder).parts)]
    return [file_download(path, f"{within}/{path.relative_to(folder)}", _begin) for path in seen]


def _begin(path: Path, size: int) -> BinaryIO:
    """The first bytes of a file: while somebody measures, lines are added to his marks."""
    with open_to_read(path, links=False) as file:
        return io.BytesIO(file.read(size))
