"""Writes what was changed while the rig runs into the rig file, as it is by then: what else was edited in it stays."""

import os
from collections.abc import Callable
from pathlib import Path

from rig.errors import StorageError
from rig.host.disk import replace_file
from rig.phrase import Phrase
from rig.settings.strict_toml import read_text


def keep(path: Path, edit: Callable[[str], str], not_kept: Callable[[str], Phrase]) -> None:
    """Edit the rig file.

    Args:
        path: of the rig file.
        edit: makes the new text of the present one.
        not_kept: what to say, given the reason, if the file cannot be written.

    Raises:
        BadInputError: the file has become unreadable.
        StorageError: it cannot be written.
    """
    text = edit(read_text(path, "TOML", "the rig file in use"))
    try:
        # Renewing a file asks for rights to its folder alone. Here those of the file decide, as its owner expects.
        os.close(os.open(path, os.O_WRONLY | os.O_CLOEXEC))
        replace_file(path, text.encode(), links=True)
    except OSError as error:
        raise StorageError(not_kept(error.strerror or str(error))) from error
