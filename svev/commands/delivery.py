"""What commands that adjust a network have in common: options of the outcome, result file, words, exit code."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from photogrammetry.adjustment.result_file import failure_to_json, write_result
from photogrammetry.diagnosis import NotConvergedError, NotSolvableError
from svev import console

OutputOption = Annotated[Path, typer.Option("-o", "--output", help="result file (svev-adjustment/1) to write")]
ReportOption = Annotated[Path | None, typer.Option("--report", help="folder for the protocol, as text and as a page")]
JsonOption = Annotated[bool, typer.Option("--json", help="end with one JSON object: the result without its lists")]

_NOT_SOLVABLE: Final = 3
_NOT_CONVERGED: Final = 4
_LISTS: Final = ("observations", "points", "images")  # too long for a screen


def deliver(compute: Callable[[], tuple[dict[str, Any], list[str]]], output: Path, *, as_json: bool) -> None:
    """Compute a result, write it, and say how it went.

    Args:
        compute: returns the result file's object and lines for people.
        output: the result file; after a failure it says what is wrong, and holds no numbers.
        as_json: end with one JSON object on standard output, the result without its lists.

    Raises:
        typer.Exit: 3 not solvable, 4 not converged.
    """
    code = 0
    try:
        result, lines = compute()
    except NotSolvableError as error:
        code, result = _NOT_SOLVABLE, failure_to_json(f"not solvable: {error}", error.defects)
        lines = ["not solvable", *(f"  {defect.message}" for defect in error.defects)]
    except NotConvergedError as error:
        code, result, lines = _NOT_CONVERGED, failure_to_json(f"not converged: {error}"), [f"not converged: {error}"]
    write_result(result, output)
    for line in lines:
        console.say(line, aside=as_json)
    if as_json:
        console.print_json({key: value for key, value in result.items() if key not in _LISTS})
    else:
        console.say(f"result in {output}")
    if code:
        raise typer.Exit(code)
