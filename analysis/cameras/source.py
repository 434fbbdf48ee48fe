"""Orients the cameras of a recording from what the operator has: the survey of the balls, or poses known already."""

from collections.abc import Mapping
from pathlib import Path
from typing import TypeAlias

from analysis.cameras.comparison import scene_of_calibration
from analysis.cameras.oriented_scene import OrientedScene, scene_of_survey, survey_id
from analysis.cameras.poses_file import Calibration, read_poses
from analysis.scene.orientation import orient_images
from analysis.scene.static_image import StaticImage
from analysis.scene.survey import Survey, read_survey
from photogrammetry.procedures.orientation import Orientation
from rig.errors import BadInputError
from rig.phrase import phrase

Source: TypeAlias = Survey | Calibration


def read_source(survey: Path | None, calibration: Path | None) -> Source:
    """Read the survey or the poses, whichever is given.

    Raises:
        BadInputError: both or neither is given, or the file is wrong.
    """
    if (survey is None) == (calibration is None):
        raise BadInputError(
            phrase(
                "source_which",
                "give either the survey of the balls (--survey) or the poses of the cameras (--calibration)",
            )
        )
    return read_survey(survey) if survey is not None else read_poses(Path(calibration or ""))


def orient_from(static: Mapping[str, StaticImage], source: Source) -> tuple[OrientedScene, Orientation | None]:
    """The cameras of static images, and the adjustment of the balls if they were oriented by it.

    Raises:
        BadInputError: survey or poses do not belong to these images; the message says why.
        NotSolvableError, NotConvergedError: of the adjustment.
    """
    if isinstance(source, Survey):
        scene = orient_images(static, source)
        return scene_of_survey(scene, survey_id(source.network)), scene.orientation
    return scene_of_calibration(static, source), None
