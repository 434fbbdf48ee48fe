"""`svev completion`: lets the shell complete commands and options."""

from typing import Annotated, Literal

import typer
from typer._completion_shared import get_completion_script

from svev import console

#: With it in its environment svev prints what may stand at the cursor, instead of running a command.
COMPLETE_VARIABLE = "_SVEV_COMPLETE"


def completion(
    shell: Annotated[
        Literal["bash", "zsh", "fish"], typer.Argument(metavar="bash|zsh|fish", help="your shell")
    ] = "bash",
) -> None:
    """Print what makes a shell complete the commands and options of svev when you press the tabulator.

    Example: svev completion bash | sudo tee /etc/bash_completion.d/svev
    """
    console.say_text(get_completion_script(prog_name="svev", complete_var=COMPLETE_VARIABLE, shell=shell))
