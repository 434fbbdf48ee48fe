"""Examines the files that the rig file names: survey or poses, calibration, plan, scenario of the simulated hill."""

from collections.abc import Iterator

from rig.errors import BadInputError
from rig.settings.model import RigSettings
from service.rig_file import read_calibration
from svev.doctor.finding import Finding, Topic, failure, passed


def look_at_survey(rig: RigSettings) -> Iterator[Finding]:
    """Can the file that `[analysis]` names be read, and are its cameras the rig's? Otherwise no jump is measured."""
    settings = rig.analysis
    if settings is None:
        return
    # a rig that measures nothing need not wait for it
    from analysis.cameras.source import read_source  # noqa: PLC0415
    from analysis.scene.survey import Survey  # noqa: PLC0415

    sizes = {camera.name: (camera.region.width, camera.region.height) for camera in rig.cameras}
    try:
        source = read_source(settings.survey, settings.calibration)
        if isinstance(source, Survey):
            lacking = source.cameras_of(sizes)[1]
        else:
            source.of_images(sizes)
            lacking = {}
    except BadInputError as error:
        remedy = "correct [analysis] in the rig file, or the file; no jump is measured before that"
        yield failure(Topic.SOFTWARE, "check_survey_wrong", "jumps cannot be measured: {why}", remedy, why=error.said)
        return
    if lacking:
        what, remedy = "{cameras} cannot measure: {why}", "add these cameras to the survey, or call them as it does"
        why = next(iter(lacking.values()))
        yield failure(Topic.SOFTWARE, "check_survey_lacks", what, remedy, cameras=", ".join(lacking), why=why)
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


def look_at_scenario(rig: RigSettings) -> Iterator[Finding]:
    """Can the scenario of simulated cameras be read, and has it these cameras? Otherwise nothing is recorded."""
    if rig.simulation is None:
        return
    from simrig.world.scenario import load_scenario  # noqa: PLC0415 - a rig of real cameras loads nothing of this

    try:
        scenario = load_scenario(rig.simulation.scenario)
        for camera in rig.cameras:
            scenario.camera_index(camera.name)
    except BadInputError as error:
        what, remedy = "nothing can be simulated: {why}", "correct scenario in the rig file, or the file"
        yield failure(Topic.SOFTWARE, "check_scenario_wrong", what, remedy, why=error.said)
    else:
        what = "the simulated hill is that of {file}"
        yield passed(Topic.SOFTWARE, "check_scenario", what, file=str(rig.simulation.scenario))
