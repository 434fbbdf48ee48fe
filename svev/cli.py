"""The command line `svev COMMAND`: finds the command, runs it, turns errors into one line and an exit code.

Exit codes: 0 done, 2 bad input, 3 a log is damaged or incomplete, `doctor` found a FAIL, or a network is not solvable,
4 storage failed or an adjustment did not converge, 5 a camera failed, 6 one of our processes died, 7 tags of a log are
contradicted by what else is in it, 130 interrupted.
`--debug` anywhere on the command line shows the traceback of an error. With `--json` an error of `svev ctl` is a JSON
object on standard output, too.
"""

import errno
import os
import re
import resource
import sys
import traceback
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from importlib import import_module
from importlib.metadata import version
from io import StringIO
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Final

import typer
from typer._completion_classes import completion_init
from typer.core import TyperGroup

from rig.doctor_call import rig_in_use
from rig.errors import BadInputError, SvevError
from rig.host.file_names import NAME_MAX
from svev import console
from svev.commands.computer.completion import COMPLETE_VARIABLE

#: Commands in the order of the help: module in `svev.commands`, function in it, one line of help. Only the module of
#: the called command is imported, so that `svev ctl` starts at once, and `record` and `serve` load no analysis.
_COMMANDS: Final = {
    "demo": ("rig.demo", "demo", "Record jumps on the simulated hill; needs no camera."),
    "record": ("rig.record", "record", "Record once with the cameras of a rig file."),
    "rehearse": ("rig.rehearse", "rehearse_command", "Rehearse a recording to the real disk."),
    "serve": ("rig.serve", "serve", "Run the rig as a service, with a control panel."),
    "ctl": ("rig.ctl", "app", "Operate a running service: arm, record, stop, list."),
    "setup": ("computer.hill", "setup", "Set up a hill: asks what it needs, writes its files."),
    "completion": ("computer.completion", "completion", "Have the shell complete commands and options."),
    "doctor": ("computer.setup", "doctor", "Examine computer, network, disk and cameras."),
    "cameras": ("computer.cameras", "app", "Find GigE Vision cameras, give them addresses."),
    "keys": ("computer.setup", "keys", "Make keys that protect published images."),
    "certificate": ("computer.certificate", "certificate", "Make a certificate for HTTPS."),
    "info": ("logs.contents", "info_command", "Say what a log holds."),
    "export": ("logs.export", "export_command", "Make a video, pictures or a table of a log."),
    "recover": ("logs.contents", "recover_command", "Repair a log that was not closed or is damaged."),
    "compact": ("logs.compact", "compact_command", "Make a log half as large, without loss."),
    "merge": ("logs.merge", "merge_command", "Make one log of two that two computers recorded."),
    "import": ("logs.importing", "import_command", "Make a log of films that other cameras took."),
    "replay": ("logs.replay", "replay_command", "Publish a log again, as it was published live."),
    "worker": ("jumps.worker", "worker_command", "Measure the jumper from published triplets."),
    "schema": ("computer.setup", "schema", "Print the JSON schema of rig files."),
    "verify": ("logs.contents", "verify_command", "Check every byte of a log."),
    "adjust": ("networks.adjust", "adjust", "Adjust a network of images (bundle adjustment)."),
    "target": ("networks.target", "target", "Make targets to print, for calibrating cameras."),
    "calibrate": ("networks.calibrate", "calibrate", "Calibrate cameras with pictures of targets."),
    "orient": ("networks.orient", "orient", "Estimate the poses of the cameras on the hill."),
    "analyze": ("jumps.analyze", "analyze_command", "Measure the jumps of a recording."),
    "digitize": ("jumps.digitize", "digitize_command", "Measure a recording by hand, in the browser."),
    "compare": ("jumps.compare", "compare", "Compare two measured jumps."),
    "season": ("jumps.season", "app", "Measure and compare the jumps of a season."),
    "network": ("networks.network", "app", "Make a network out of files of other programs."),
    "plan": ("networks.plan", "plan", "Predict the accuracy of planned cameras."),
    "bench": ("computer.bench", "bench", "Measure how fast this computer records."),
}


#: Options that were renamed; scripts may still use their former names, which no help shows.
_FORMER_NAMES: Final = {"--output": "--out", "--marks": "--out"}
#: Open files that are asked for, and the fewest that will do, beside those open already.
_FILES: Final = 4096
_LEAST_FILES: Final = 48
#: The base of errors in the use of options and arguments, which Typer does not name.
_USAGE_ERROR: Final[type[Exception]] = typer.BadParameter.__mro__[1]


class _Commands(TyperGroup):
    """All commands; help names an argument by its metavar alone, without type or braces, and ranges in words."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        left: list[Any] = [self]
        while left:
            command = left.pop()
            left += getattr(command, "commands", {}).values()
            for parameter in command.params:
                if parameter.param_type_name == "argument":
                    parameter.display_type_rich = _no_type
                    parameter._usage_display_name = partial(_in_usage, parameter)
                parameter._get_number_range_help_str = partial(_range, parameter)


def _no_type(ctx: Any) -> None:
    """The type of an argument as help shows it: not at all."""


def _in_usage(argument: Any) -> str:
    """An argument in the line that shows how a command is used."""
    name = argument.metavar if argument.nargs == 1 else f"{argument.metavar.removesuffix('...')}..."
    return name if argument.required else f"[{name}]"


def _range(parameter: Any) -> str | None:
    """The numbers that an option or argument allows, in words."""
    least, most = (None if end is None else f"{end:.10g}" for end in (parameter.min, parameter.max))
    if least is not None and most is not None:
        return f"{least} to {most}"
    return f"at least {least}" if least is not None else None if most is None else f"at most {most}"


def command_line(names: Iterable[str] = _COMMANDS) -> typer.Typer:
    """Make the command line with the commands `names`."""
    app = _without_commands()
    for name in names:
        module, attribute, short_help = _COMMANDS[name]
        command = getattr(import_module(f"svev.commands.{module}"), attribute)
        if isinstance(command, typer.Typer):
            app.add_typer(command, name=name, short_help=short_help)
        else:
            app.command(name, short_help=short_help)(command)
    return app


def _overview() -> typer.Typer:
    """The command line with the names of all commands, none of which it can run: enough for `svev --help`."""
    app = _without_commands()
    for name, (_, _, short_help) in _COMMANDS.items():
        app.command(name, short_help=short_help)(_every_command)
    return app


def _without_commands() -> typer.Typer:
    app = typer.Typer(
        name="svev",
        cls=_Commands,
        help="Live capture and photogrammetry for three synchronized cameras at a ski jump.",
        epilog="Add --debug anywhere to see the traceback of an error. Start with: svev demo",
        no_args_is_help=True,
        add_completion=False,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.callback()(_every_command)
    return app


def _say_version(wanted: bool) -> None:
    if wanted:
        console.say(f"svev {version('svev')}, in {sys.prefix}")
        raise typer.Exit


def _every_command(
    _: Annotated[
        bool,
        typer.Option("--version", callback=_say_version, is_eager=True, help="say which version this is, and where"),
    ] = False,
) -> None:
    """Live capture and photogrammetry for three synchronized cameras at a ski jump."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command.

    Returns:
        The exit code, see the docstring of this module.
    """
    argv = list(sys.argv[1:] if arguments is None else arguments)
    debug = "--debug" in argv
    argv = [_present_name(argument) for argument in argv if argument != "--debug"]
    as_json = argv[:1] == ["ctl"] and "--json" in argv
    try:
        _open_standard_streams()
        _allow_open_files()
        if COMPLETE_VARIABLE in os.environ:
            command = _completed(os.environ)
        elif argv and argv[0] in _COMMANDS:
            command = command_line(argv[:1])
        else:
            command = command_line() if any(word in _COMMANDS for word in argv) else _overview()
        with rig_in_use(_rig_file(argv)):
            code = command(argv, prog_name="svev", standalone_mode=False)
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else 1
    except _USAGE_ERROR as error:
        return _explain_usage(error, as_json=as_json)
    except BrokenPipeError:
        # The reader of our output has gone: a message would reach nobody.
        sys.stderr.close()
        return 1
    except (SvevError, OSError) as error:
        if debug:
            traceback.print_exc()
        told = _one_line(error)
        console.complain(told)
        code = error.exit_code if isinstance(error, SvevError) else 2
        if as_json:
            console.print_json_line({"error": told, "exit_code": code})
        return code
    return code if isinstance(code, int) else 0  # a number: --help, or a command that ends with a code of its own


def _present_name(word: str) -> str:
    """The present name of an option that was called otherwise in an earlier version; other words as they are."""
    name, equals, value = word.partition("=")
    return f"{_FORMER_NAMES.get(name, name)}{equals}{value}"


def _completed(environment: Mapping[str, str]) -> typer.Typer:
    """The command line that completes itself for a shell: all names, or one command with its options.

    Args:
        environment: holds the words until the cursor, in the form of each shell.
    """
    completion_init()
    words = re.split(r"[ \n]", environment.get("COMP_WORDS") or environment.get("_TYPER_COMPLETE_ARGS", ""))
    if len(words) > 2 and words[1] in _COMMANDS:
        return command_line(words[1:2])
    return _overview()


def _open_standard_streams() -> None:
    """Let a standard stream that the caller has closed (`>&-`) swallow everything: he wants the exit code alone.

    Otherwise the next file that is opened, a log perhaps, would take its number, and libraries would write into it.
    """
    for number, name, mode in ((0, "stdin", "r"), (1, "stdout", "w"), (2, "stderr", "w")):
        try:
            os.fstat(number)
        except OSError:
            nothing = os.open(os.devnull, os.O_RDWR)
            if nothing != number:
                os.dup2(nothing, number)
                os.close(nothing)
            os.set_inheritable(number, True)  # our children would open their files under the number otherwise
        if getattr(sys, name) is None:
            setattr(sys, name, open(number, mode, encoding="utf-8", closefd=False))  # noqa: SIM115


def _allow_open_files() -> None:
    """Allow this process and its children as many open files as they may have.

    Raises:
        BadInputError: that is too few: sockets, shared memory and the files of Python modules would not fit.
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    allowed = _FILES if hard == resource.RLIM_INFINITY else min(hard, _FILES)
    if soft != resource.RLIM_INFINITY and soft < allowed:
        resource.setrlimit(resource.RLIMIT_NOFILE, (allowed, hard))
    left = allowed - len(os.listdir("/proc/self/fd"))  # noqa: PTH208 - a list of numbers, no paths
    if left < _LEAST_FILES:
        raise BadInputError(
            f"only {left} more files may be opened here, and svev needs {_LEAST_FILES}: run `ulimit -n 1024` and call "
            "again"
        )


def _explain_usage(error: Any, *, as_json: bool) -> int:
    """Print what is wrong with the command line.

    Returns:
        The exit code.
    """
    text = StringIO()
    error.show(file=text)
    for line in text.getvalue().rstrip("\n").split("\n"):
        console.say(line, aside=True)
    code: int = error.exit_code
    if as_json:
        console.print_json_line({"error": error.format_message(), "exit_code": code})
    return code


def _rig_file(argv: Sequence[str]) -> Path | None:
    """The rig file that a command line names."""
    rig = next((after for option, after in pairwise(argv) if option == "--rig"), None)
    rig = rig or next((word.partition("=")[2] for word in argv if word.startswith("--rig=")), None)
    return Path(rig) if rig else None


def _one_line(error: SvevError | OSError) -> str:
    """The error as one line: what is wrong and what to do."""
    if isinstance(error, SvevError):
        return str(error)
    if error.errno in {errno.EMFILE, errno.ENFILE}:
        limit, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
        return f"too many files are open ({limit} are allowed here): run `ulimit -n 4096` and call again"
    if error.errno in {errno.EEXIST, errno.ENOTDIR}:
        return f"{error.filename}: a folder is wanted, and there is a file; choose another path"
    remedy = (
        f"choose a name of at most {NAME_MAX} bytes"
        if error.errno == errno.ENAMETOOLONG
        else "check the path and its permissions"
    )
    return f"{error.filename or 'system call'}: {error.strerror}; {remedy}"
