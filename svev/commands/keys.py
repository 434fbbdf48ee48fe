"""`svev keys`: makes the keys with which published images are encrypted."""

from pathlib import Path
from typing import Annotated

import typer

from recorder.publishing.keys import make_keys
from svev import console


def keys(
    name: Annotated[Path, typer.Argument(help="beginning of the names of both files, e.g. /etc/svev/hill")],
    as_json: Annotated[bool, typer.Option("--json", help="end with one JSON object")] = False,
) -> None:
    """Make a pair of keys (ZeroMQ CURVE), so that only programs that have one of them can take published images.

    NAME.key_secret stays on this computer: name it in the rig file, `curve_key_file` in `[network]`. NAME.key is for
    subscribers; whoever has it may subscribe. Existing files are never overwritten.

    Exit codes: 0; 2 a file exists already or cannot be written.

    Example: svev keys hill
    """
    secret, public = make_keys(name)
    if as_json:
        console.print_json({"secret": str(secret), "public": str(public)})
        return
    console.say(f'{secret}: for the publisher; in the rig file: [network] curve_key_file = "{secret}"')
    console.say(f"{public}: for subscribers; give it only to those who may see the images")
