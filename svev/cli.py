"""The command line: `svev COMMAND`.

Exit codes: 0 done, 2 bad input, 3 a log is damaged or incomplete, 4 storage failed, 5 a camera failed,
6 one of our processes died, 130 interrupted. Errors are one line; `--debug` anywhere shows the traceback.
"""

import sys
import traceback
from collections.abc import Sequence

import typer

from rig.errors import SvevError
from svev import console
from svev.commands import schema

app = typer.Typer(
    name="svev",
    help="Live capture and photogrammetry for three synchronized cameras at a ski jump.",
    epilog="Add --debug anywhere to see the traceback of an error. Start with: svev demo",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


@app.callback()
def _every_command() -> None:
    """Live capture and photogrammetry for three synchronized cameras at a ski jump."""


app.command("schema")(schema.schema)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command.

    Returns:
        The exit code, see the module's description.
    """
    argv = list(sys.argv[1:] if arguments is None else arguments)
    debug = "--debug" in argv
    argv = [argument for argument in argv if argument != "--debug"]
    try:
        app(argv, prog_name="svev")
    except SystemExit as end:  # --help, a wrong option, or a command that ends with a code of its own
        return end.code if isinstance(end.code, int) else 1
    except SvevError as error:
        code, line = error.exit_code, str(error)
    except BrokenPipeError:
        # Whoever read our output went away; there is nobody left to tell.
        sys.stderr.close()
        return 1
    except OSError as error:
        code, line = 2, f"{error.filename or 'system call'}: {error.strerror}; check the path and its permissions"
    else:
        return 0
    if debug:
        traceback.print_exc()
    console.complain(line)
    return code
