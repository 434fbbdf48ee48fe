"""What the commands of photogrammetry have in common: options, weights, result file, report, exit codes."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from photogrammetry.adjustment.solution.adjustment import Adjustment
from photogrammetry.network.diagnosis import NotConvergedError, NotSolvableError, RefusedError
from photogrammetry.network.model import Network, Reweight
from photogrammetry.reports.document import Report, write_report
from photogrammetry.reports.record.provenance import Provenance, provenance, signature
from photogrammetry.reports.result_extras import joint_covariance, with_detectable
from photogrammetry.reports.result_file import failure_to_json, write_result
from rig.errors import BadInputError
from svev import console
from svev.clock_warning import warn_of_clock

OutputOption = Annotated[
    Path, typer.Option("-o", "--out", metavar="FILE", help="result file (svev-adjustment/1) to write")
]
ReportOption = Annotated[
    Path | None, typer.Option("--report", metavar="DIR", help="folder for the report, as text and as a page")
]
JsonOption = Annotated[bool, typer.Option("--json", help="end with one JSON object: the result without its lists")]
SurveyOption = Annotated[
    Path | None, typer.Option("--survey", metavar="SURVEY.json", help="survey of the balls with interior orientations")
]
PosesOption = Annotated[
    Path | None, typer.Option("--calibration", metavar="POSES.json", help="poses of the cameras, result of svev orient")
]


class Alternative(StrEnum):
    """Which points tie the images of the cameras together (paper, step 2)."""

    STATIC = "1"
    MOVING_TOO = "2"


#: Of `orient` and `analyze`; the default of both is that of the paper's first alternative.
AlternativeOption = Annotated[
    Alternative,
    typer.Option(
        "--alternative", metavar="1|2", help="1: static points alone orient the cameras; 2: the moving helmet too"
    ),
]
ReweightOption = Annotated[
    bool,
    typer.Option(
        "--reweight", help="estimate the weights of images and survey from the residuals, group by group (D.3)"
    ),
]
DetectableOption = Annotated[
    bool, typer.Option("--detectable", help="add the smallest error of each observation that would be found")
]
CovarianceOption = Annotated[
    list[str] | None,
    typer.Option(
        "--covariance", metavar="NAME", help="add the joint covariance of points with this name (* and ?); repeatable"
    ),
]
PaperOption = Annotated[bool, typer.Option("--paper", help="estimate the weights by D5 as the paper prints it")]

#: Exit codes.
NOT_SOLVABLE: Final = 3
NOT_CONVERGED: Final = 4
REFUSED: Final = RefusedError.exit_code
_LISTS: Final = ("observations", "points", "images", "calibration")  # too long for a screen


def origin(context: typer.Context, **files: Path | None) -> Provenance:
    """Where the result of this call comes from, for its report.

    Args:
        context: of the command; its options are told.
        files: that it reads, by their role.
    """
    options = [
        f"--{name.replace('_', '-')}" if value is True else f"--{name.replace('_', '-')} {each}"
        for name, value in context.params.items()
        if name not in (*files, "force") and not isinstance(value, Path) and value not in (None, False)
        for each in (value if isinstance(value, list | tuple) else (value,))
    ]
    made = provenance(" ".join(("svev", str(context.info_name), *options)), files)
    return replace(made, doubt=warn_of_clock(path for path in files.values() if path is not None))


def written(make: Callable[[], Report], folder: Path | None) -> list[str]:
    """Write a report, if `folder` is given; returns the line that says where it is."""
    if folder is None:
        return []
    text, page = write_report(make(), folder)
    return [f"report in {text} and {page}"]


def as_record(report: Report, came_from: Provenance, result: Mapping[str, Any], output: Path) -> Report:
    """A report with its origin, the checksum of the result file, and a place to sign."""
    origin_of_all = came_from.with_result(result, output).section()
    return replace(report, sections=(origin_of_all, *report.sections, signature()))


def with_extras(
    result: dict[str, object], a: Adjustment, *, detectable: bool, covariance: Sequence[str] | None
) -> dict[str, object]:
    """The result with what `--detectable` and `--covariance` add."""
    if detectable:
        result = with_detectable(result, a)
    return result | {"joint_covariance": joint_covariance(a, covariance)} if covariance else result


def deliver(compute: Callable[[], tuple[dict[str, object], list[str]]], output: Path, *, as_json: bool) -> None:
    """Compute a result, write its file, and print lines for people.

    Args:
        compute: returns the result file's object and lines for people.
        output: the result file; after a failure it has the diagnosis and no numbers.
        as_json: end with one JSON object on standard output, the result without its lists.

    Raises:
        typer.Exit: 3 not solvable, 4 not converged or refused.
    """
    code = 0
    try:
        result, lines = compute()
    except NotSolvableError as error:
        code, result = NOT_SOLVABLE, failure_to_json(f"not solvable: {error}", error.defects)
        lines = ["not solvable", *(f"  {defect.message}" for defect in error.defects)]
    except NotConvergedError as error:
        code, result, lines = NOT_CONVERGED, failure_to_json(f"not converged: {error}"), [f"not converged: {error}"]
    except RefusedError as error:
        code, result, lines = REFUSED, failure_to_json(f"refused: {error}"), [f"refused: {error}"]
    write_result(result, output)
    for line in lines:
        console.say(line, aside=as_json)
    if as_json:
        console.print_json({key: value for key, value in result.items() if key not in _LISTS})
    else:
        console.say(f"result in {output}")
    if code:
        raise typer.Exit(code)


def refuse_overwriting(output: Path, *inputs: Path | None) -> None:
    """Refuse to write a result over what it is computed from, also by another name of the same file.

    Raises:
        BadInputError: the output is one of the inputs.
    """
    for path in inputs:
        if path is not None and output.exists() and path.exists() and output.samefile(path):
            raise BadInputError(f"{output}: is an input and would be overwritten; name another file to write")


def with_weights(network: Network, *, reweight: bool, paper: bool) -> Network:
    """The network with the weights that the options ask for; without options those that its file asks for.

    Raises:
        BadInputError: both options are given.
    """
    if reweight and paper:
        raise BadInputError("--reweight and --paper estimate the weights in two different ways: choose one")
    if not (reweight or paper):
        return network
    return replace(network, reweight=Reweight.PAPER if paper else Reweight.HELMERT)
