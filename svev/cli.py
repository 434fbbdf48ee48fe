"""The command line: `svev COMMAND`.

Exit codes: 0 done, 2 bad input, 3 a log is damaged or incomplete, `doctor` found a FAIL, or a network is not solvable,
4 storage failed or an adjustment did not converge, 5 a camera failed, 6 one of our processes died, 130 interrupted.
Errors are one line; `--debug` anywhere shows the traceback.
"""

import sys
import traceback
from collections.abc import Sequence

import typer

from rig.errors import SvevError
from svev import console
from svev.commands import (
    adjust,
    bench,
    calibrate,
    ctl,
    demo,
    doctor,
    info,
    orient,
    plan,
    record,
    recover,
    replay,
    schema,
    serve,
    verify,
)

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


app.command("demo")(demo.demo)
app.command("record")(record.record)
app.command("serve")(serve.serve)
app.add_typer(ctl.app, name="ctl")
app.command("doctor")(doctor.doctor)
app.command("info")(info.info_command)
app.command("recover")(recover.recover_command)
app.command("replay")(replay.replay_command)
app.command("schema")(schema.schema)
app.command("verify")(verify.verify_command)
app.command("adjust")(adjust.adjust)
app.command("calibrate")(calibrate.calibrate)
app.command("orient")(orient.orient)
app.command("plan")(plan.plan)
app.command("bench")(bench.bench)


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
