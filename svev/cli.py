"""The command line: `svev COMMAND`.

Exit codes: 0 done, 2 bad input, 3 a log is damaged or incomplete, `doctor` found a FAIL, or a network is not solvable,
4 storage failed or an adjustment did not converge, 5 a camera failed, 6 one of our processes died, 130 interrupted.
Errors are one line; `--debug` anywhere shows the traceback.
"""

import sys
import traceback
from collections.abc import Iterable, Sequence
from importlib import import_module
from typing import Final

import typer

from rig.errors import SvevError
from svev import console

#: In the order of the help: module in `svev.commands`, and what stands for the command there. Only the module of the
#: command that is called is imported: `svev ctl` answers at once, and the service carries no photogrammetry around.
_COMMANDS: Final = {
    "demo": ("demo", "demo"),
    "record": ("record", "record"),
    "serve": ("serve", "serve"),
    "ctl": ("ctl", "app"),
    "doctor": ("doctor", "doctor"),
    "info": ("info", "info_command"),
    "recover": ("recover", "recover_command"),
    "replay": ("replay", "replay_command"),
    "schema": ("schema", "schema"),
    "verify": ("verify", "verify_command"),
    "adjust": ("adjust", "adjust"),
    "calibrate": ("calibrate", "calibrate"),
    "orient": ("orient", "orient"),
    "plan": ("plan", "plan"),
    "bench": ("bench", "bench"),
}


def command_line(names: Iterable[str] = _COMMANDS) -> typer.Typer:
    """The command line with these commands."""
    app = typer.Typer(
        name="svev",
        help="Live capture and photogrammetry for three synchronized cameras at a ski jump.",
        epilog="Add --debug anywhere to see the traceback of an error. Start with: svev demo",
        no_args_is_help=True,
        add_completion=False,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
    )
    app.callback()(_every_command)
    for name in names:
        module, attribute = _COMMANDS[name]
        command = getattr(import_module(f"svev.commands.{module}"), attribute)
        if isinstance(command, typer.Typer):
            app.add_typer(command, name=name)
        else:
            app.command(name)(command)
    return app


def _every_command() -> None:
    """Live capture and photogrammetry for three synchronized cameras at a ski jump."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command.

    Returns:
        The exit code, see the module's description.
    """
    argv = list(sys.argv[1:] if arguments is None else arguments)
    debug = "--debug" in argv
    argv = [argument for argument in argv if argument != "--debug"]
    try:
        command_line(argv[:1] if argv and argv[0] in _COMMANDS else _COMMANDS)(argv, prog_name="svev")
    except SystemExit as end:  # --help, a wrong option, or a command that ends with a code of its own
        return end.code if isinstance(end.code, int) else 1
    except BrokenPipeError:
        # Whoever read our output went away; there is nobody left to tell.
        sys.stderr.close()
        return 1
    except (SvevError, OSError) as error:
        if debug:
            traceback.print_exc()
        console.complain(_one_line(error))
        return error.exit_code if isinstance(error, SvevError) else 2
    return 0


def _one_line(error: SvevError | OSError) -> str:
    """The error for people: what is wrong and what to do."""
    if isinstance(error, SvevError):
        return str(error)
    return f"{error.filename or 'system call'}: {error.strerror}; check the path and its permissions"
