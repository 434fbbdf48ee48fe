"""How messages say to run the doctor: with the rig file in use, which `svev doctor` would not look at by itself.

A program tells its child processes by an environment variable: what cameras say becomes a message in the recorder.
"""

import os
import re
import shlex
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

_VARIABLE: Final = "SVEV_RIG_FILE"


def doctor_call() -> str:
    """The command that examines the rig in use, as a person types it."""
    rig_file = os.environ.get(_VARIABLE)
    return "svev doctor" if rig_file is None else f"svev doctor --rig {shlex.quote(rig_file)}"


def with_rig_in_use(text: str) -> str:
    """A text of a camera, in whose record there is no room for the path of a rig file, with `doctor_call`."""
    return re.sub(r"svev doctor(?! --)", lambda _: doctor_call(), text)


@contextmanager
def rig_in_use(rig_file: Path | None) -> Iterator[None]:
    """In here, and in processes that are started in here, this rig file is in use; None: as before."""
    before = os.environ.get(_VARIABLE)
    if rig_file is not None:
        os.environ[_VARIABLE] = str(rig_file.absolute())
    try:
        yield
    finally:
        if before is None:
            os.environ.pop(_VARIABLE, None)
        else:
            os.environ[_VARIABLE] = before
