"""Chooses what the places of the balls in a camera's picture follow from: poses, the last orientation, survey or plan.

Given poses come first: with them in the rig file a camera is to stand where they say, and a picture with the balls
elsewhere is of a camera that has moved. A survey says roughly at most where cameras stand, so with it the last
orientation counts. The plan is for the first day.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from analysis.cameras.oriented_scene import survey_id
from analysis.cameras.poses_file import Calibration, read_poses
from analysis.scene.survey import Survey, read_survey
from photogrammetry.network.model import Camera, Image, Point
from photogrammetry.planning.description import read_description
from photogrammetry.planning.plan import plan_from
from rig.api.cameras.balls import BallPlace, BallSource, CameraBalls
from rig.api.statement import Level, Statement
from rig.arrays import Floats
from rig.errors import BadInputError
from rig.phrase import Phrase, phrase
from rig.settings.camera import CameraSettings
from rig.settings.model import RigSettings
from rig.settings.region import calibration_unfit
from service.aiming.kept import kept_in
from service.aiming.places import Balls, of_system, places, standing

_NO_FILE: Final = Statement(
    code="balls_no_file",
    text="where the balls should be is not known: the rig file names no survey of them",
    advice='name it, survey = "survey.json" under [analysis]; before there is one, name the plan, plan = "plan.toml"',
)


def known_balls(rig: RigSettings, camera: CameraSettings, folder: Path) -> CameraBalls:
    """Where a camera should show the balls, or why that is not known.

    Args:
        rig: the rig.
        camera: one of its cameras.
        folder: of the recordings.
    """
    size = _size(camera)
    nothing = CameraBalls(camera=camera.name, width=size[0], height=size[1])
    try:
        found = _found(rig, camera, folder, nothing)
    except BadInputError as error:
        statement = Statement(
            level=Level.WARNING,
            code="balls_unknown",
            text=f"where {camera.name} shows the balls is not known: {error}",
            values={"camera": camera.name, "why": error.said},
        )
        return nothing.model_copy(update={"statement": statement})
    if found is not None:
        return found
    if rig.analysis is None:
        return nothing.model_copy(update={"statement": _NO_FILE})
    statement = Statement(
        code="balls_not_oriented",
        text=f"{camera.name} is not oriented yet, so where it shows the balls is not known",
        advice="record five seconds with the balls in sight once; or give its approximate pose in the survey, or name "
        'the plan in the rig file, plan = "plan.toml"',
        values={"camera": camera.name},
    )
    return nothing.model_copy(update={"statement": statement})


def _found(rig: RigSettings, camera: CameraSettings, folder: Path, nothing: CameraBalls) -> CameraBalls | None:
    """The places by the best of what there is; None: there is nothing that says it."""
    given = rig.analysis
    if (unfit := calibration_unfit(camera)) is not None:
        raise BadInputError(unfit)
    if given is not None and given.calibration is not None:
        balls = _of_calibration(read_poses(given.calibration), camera)
        return _told(nothing, BallSource.CALIBRATION, balls, given.calibration)
    lacking: Phrase | None = None
    if given is not None and given.survey is not None:
        survey = read_survey(given.survey)
        kept = kept_in(folder).get(camera.name)
        if kept is not None and (kept.given, kept.region) == (survey_id(survey.network), camera.region):
            oriented = _told(nothing, BallSource.ORIENTATION, kept.balls, given.survey)
            return oriented.model_copy(update={"oriented": kept.oriented, "recording": kept.recording})
        if not survey.has(camera.name):
            lacking = survey.lacks(camera.name)
        elif (approximate := _of_survey(survey, camera)) is not None:
            return _told(nothing, BallSource.SURVEY, approximate, given.survey)
    if rig.plan is not None:
        planned = _told(nothing, BallSource.PLAN, _of_plan(rig.plan, camera), rig.plan)
        return planned if lacking is None else planned.model_copy(update={"statement": _by_plan(camera, str(lacking))})
    if lacking is not None:
        raise BadInputError(lacking)
    return None


def _by_plan(camera: CameraSettings, why: str) -> Statement:
    """The survey cannot measure with this camera, although the plan says where it should show the balls."""
    return Statement(
        level=Level.WARNING,
        code="balls_by_plan",
        text=f"{camera.name} shows the balls where the plan has them, and will not be oriented: {why}",
        values={"camera": camera.name, "why": why},
    )


def _told(nothing: CameraBalls, source: BallSource, balls: tuple[BallPlace, ...], file: Path) -> CameraBalls:
    return nothing.model_copy(update={"source": source, "balls": balls, "file": file.name})


def _of_calibration(calibration: Calibration, camera: CameraSettings) -> tuple[BallPlace, ...]:
    system, _ = calibration.of_images({camera.name: _size(camera)})
    balls = calibration.balls
    xyz = np.array([ball.xyz for ball in balls.values()], float).reshape(-1, 3)
    covariance = np.array([ball.covariance for ball in balls.values()], float).reshape(-1, 3, 3)
    seen = [camera.name in ball.images for ball in balls.values()]
    return of_system(system, camera.name, Balls(tuple(balls), xyz, covariance, seen))


def _of_survey(survey: Survey, camera: CameraSettings) -> tuple[BallPlace, ...] | None:
    """None: the survey has no approximate pose of the camera."""
    known, image = survey.camera(camera.name), survey.image(camera.name)
    if image is None or image.position is None:
        return None
    _require_size(known, camera, survey.source)
    return _at_pose(known, image, survey.network.points)


def _of_plan(path: Path, camera: CameraSettings) -> tuple[BallPlace, ...]:
    description = read_description(path)
    network = plan_from(description).network
    known = next((known for known in network.cameras if known.name == camera.name), None)
    stations = [image for image in network.images if known is not None and network.cameras[image.camera] is known]
    if known is None or len(stations) != 1:
        text = "{path}: has {count} stations of {camera}; give each camera of the rig one, by its name in the rig file"
        raise BadInputError(phrase("why_balls_plan", text, path=str(path), count=len(stations), camera=camera.name))
    _require_size(known, camera, str(path))
    targets = network.points[: len(description.target_names())]  # the points of the jumper come after them
    return _at_pose(known, stations[0], targets)


def _at_pose(camera: Camera, image: Image, points: Sequence[Point]) -> tuple[BallPlace, ...]:
    """Where a camera would show points at a pose that is given, perhaps roughly."""
    if image.position is None or image.rotation is None:
        raise ValueError("only an image with a pose can be asked")
    return places(standing(camera, image.position, image.rotation), _pose_covariance(image), _points(points))


def _pose_covariance(image: Image) -> Floats | None:
    """Of an approximate pose; None if it does not say how good it is."""
    if image.sigma_position is None or image.sigma_angles is None:
        return None
    return np.asarray(np.diag(np.concatenate((image.sigma_position, image.sigma_angles)) ** 2))


def _points(points: Sequence[Point]) -> Balls:
    """The points that have coordinates."""
    there = [point for point in points if point.xyz is not None]
    xyz = np.array([point.xyz for point in there], float).reshape(-1, 3)
    sigmas = [np.zeros(3) if point.sigma is None else point.sigma for point in there]
    return Balls([p.name for p in there], xyz, np.array([np.diag(s**2) for s in sigmas], float).reshape(-1, 3, 3))


def _size(camera: CameraSettings) -> tuple[int, int]:
    return camera.region.width, camera.region.height


def _require_size(known: Camera, camera: CameraSettings, source: str) -> None:
    size = _size(camera)
    if known.size != size:
        there = "unknown size" if known.size is None else f"{known.size[0]} x {known.size[1]} px"
        text = "{path}: {camera} has pictures of {there} there, and of {here} in the rig file; correct one of them"
        here = f"{size[0]} x {size[1]} px"
        raise BadInputError(phrase("why_balls_size", text, path=source, camera=camera.name, there=there, here=here))
