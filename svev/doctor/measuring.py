"""Examines what jumps are measured with: the survey of the balls, or the poses of the cameras."""

from collections.abc import Iterator

from rig.errors import BadInputError
from rig.settings.model import RigSettings
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
