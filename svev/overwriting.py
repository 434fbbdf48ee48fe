"""Files that commands write: what is there already stays, unless the person says otherwise."""

from pathlib import Path
from typing import Annotated, Final

import typer

from rig.errors import BadInputError

ForceOption = Annotated[bool, typer.Option("--force", help="replace what is there under the name of an output")]
#: Files of a report, in its folder.
_REPORT: Final = ("protocol.txt", "protocol.html")


def refuse_existing(*outputs: Path | None, force: bool) -> None:
    """Refuse to write where a file is already.

    Args:
        outputs: files that are to be written; None: one that was not asked for.
        force: the person wants them replaced.

    Raises:
        BadInputError: one of them exists, or is a folder.
    """
    for path in outputs:
        if path is not None and path.is_dir():
            raise BadInputError(f"{path}: is a folder; name a file in it")
        if path is not None and path.is_file() and not force:
            raise BadInputError(f"{path}: exists already; choose another name, or replace it by --force")


def in_report(folder: Path | None) -> tuple[Path, ...]:
    """Files of a report that is written into this folder."""
    return () if folder is None else tuple(folder / name for name in _REPORT)
