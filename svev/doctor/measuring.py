"""Examines the files for measuring that the rig file names: the survey or the poses, the calibration, the plan."""

from collections.abc import Iterator

from rig.errors import BadInputError
from rig.settings.model import RigSettings
from service.recordings.calibration import read_calibration
from svev.doctor.finding import Finding, Topic, failure, passed


def look_at_survey(rig: RigSettings) -> Iterator[Finding]:
    """Can the file that `[analysis]` of the rig file names be read? Otherwise no jump of a training is measured."""
    settings = rig.analysis
    if settings is None:
        return
    from analysis.cameras.source import read_source  # noqa: PLC0415 - a rig that measures nothing need not wait for it

    try:
        read_source(settings.survey, settings.calibration)
    except BadInputError as error:
        remedy = "correct [analysis] in the rig file, or the file; no jump is measured before that"
        yield failure(Topic.SOFTWARE, "check_survey_wrong", "jumps cannot be measured: {why}", remedy, why=error.said)
    else:
        yield passed(
            Topic.SOFTWARE,
            "check_survey",
            "jumps are measured by {file}",
            file=str(settings.survey or settings.calibration),
        )


def look_at_calibration(rig: RigSettings) -> Iterator[Finding]:
    """Can the calibration be read that stands in every log? Without it nothing is recorded."""
    if rig.calibration is None:
        return
    try:
        read_calibration(rig)
    except BadInputError as error:
        what, remedy = "nothing can be recorded: {why}", "correct calibration in the rig file, or the file"
        yield failure(Topic.SOFTWARE, "check_calibration_wrong", what, remedy, why=error.said)
    else:
        what = "logs hold the calibration in {file}"
        yield passed(Topic.SOFTWARE, "check_calibration", what, file=str(rig.calibration))


def look_at_plan(rig: RigSettings) -> Iterator[Finding]:
    """Can the planned network be read? Otherwise the page does not show where the balls should be."""
    if rig.plan is None:
        return
    from photogrammetry.planning.description import read_description  # noqa: PLC0415 - as above
    from photogrammetry.planning.plan import plan_from  # noqa: PLC0415

    try:
        plan_from(read_description(rig.plan))
    except BadInputError as error:
        what, remedy = "the page cannot help to aim: {why}", "correct plan in the rig file, or the file"
        yield failure(Topic.SOFTWARE, "check_plan_wrong", what, remedy, why=error.said)
    else:
        yield passed(Topic.SOFTWARE, "check_plan", "cameras are aimed by {file}", file=str(rig.plan))
