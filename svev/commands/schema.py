"""`svev schema`: the JSON schema of the rig file."""

from pathlib import Path
from typing import Annotated

import typer

from rig.rigfile import rig_schema
from svev import console


def schema(
    output: Annotated[Path | None, typer.Option("-o", "--output", help="write it to this file instead")] = None,
) -> None:
    """Print the JSON schema of the rig file, for editors that check TOML while you type.

    Example: svev schema -o rig.schema.json
    """
    if output is None:
        console.say(rig_schema().rstrip())
    else:
        output.write_text(rig_schema(), encoding="utf-8")
