"""Balls that a person clicked: cameras oriented by them alone (paper, step 2, alternative 1), and as a network."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from analysis.cameras.source import Source
from analysis.digitizing.marks.effective import sigma_of
from analysis.digitizing.marks.journal import Entered, Key
from analysis.digitizing.marks.things import LANDMARK, ball_of
from analysis.scene.camera_system import CameraSystem, camera_system
from analysis.scene.survey import Survey
from photogrammetry.network.file import pixel_to_metric
from photogrammetry.network.model import Image, ImageObservations, Network, Point, Role
from photogrammetry.procedures.orientation import orient
from rig.api.digitizing import MarkState
from rig.errors import BadInputError
from rig.phrase import phrase

#: Clicked balls without which a camera is left out.
_FEWEST_BALLS: Final = 4


def clicks_can_help(sizes: Mapping[str, tuple[int, int]], source: Source) -> bool:
    """Whether clicked balls can orient a camera: there is a survey, and it has one of the log, for such images.

    Args:
        sizes: width and height of the images by camera, px.
        source: survey or poses.
    """
    try:
        return isinstance(source, Survey) and bool(source.cameras_of(sizes)[0])
    except BadInputError:
        return False


def orient_by_clicks(
    sizes: Mapping[str, tuple[int, int]], source: Source, marks: Mapping[Key, Entered]
) -> tuple[CameraSystem, list[str]]:
    """Orient the cameras in whose images enough balls were clicked.

    Args:
        sizes: width and height of the images by camera, px.
        source: the survey of the balls.
        marks: the clicked balls; other marks are left out.

    Returns:
        The cameras, and what a person should know, one line each.

    Raises:
        BadInputError: poses are given and no survey, or too few balls were clicked.
        NotSolvableError, NotConvergedError, RefusedError: of the adjustment.
    """
    if not isinstance(source, Survey):
        raise BadInputError(
            phrase(
                "hand_poses_given",
                "the cameras' poses are given: to orient by clicked balls, give the survey of the balls",
            )
        )
    network = source.network
    names = {point.name: i for i, point in enumerate(network.points)}
    placed, _ = source.cameras_of(sizes)
    clicked: dict[str, dict[str, Entered]] = {name: {} for name in placed}
    for key, entered in marks.items():
        ball = ball_of(key.thing)
        if ball in names and key.camera in clicked and entered.state is MarkState.MEASURED and entered.xy:
            clicked[key.camera][ball] = entered
    used = [name for name, balls in clicked.items() if len(balls) >= _FEWEST_BALLS]
    if not used:
        most = max((len(balls) for balls in clicked.values()), default=0)
        raise BadInputError(
            phrase(
                "hand_few_balls",
                "an image needs {fewest} clicked balls or more, five to be sure; most have {most}",
                fewest=_FEWEST_BALLS,
                most=most,
            )
        )
    seen = sorted({ball for name in used for ball in clicked[name]}, key=names.__getitem__)
    rows = [(i, seen.index(ball), entered) for i, name in enumerate(used) for ball, entered in clicked[name].items()]
    observations = _observations(rows, [sizes[name] for name in used])
    chosen = replace(
        network,
        cameras=tuple(placed[name] for name in used),
        images=tuple(Image(name, i) for i, name in enumerate(used)),
        points=tuple(network.points[names[ball]] for ball in seen),
        observations=observations,
        distances=(),
        differences=(),
    )
    orientation = orient(chosen, uncertain_interior=True)
    return camera_system(orientation, tuple(sizes)), list(orientation.notes)


def clicked_network(
    sizes: Mapping[str, tuple[int, int]], survey: Survey, marks: Iterable[tuple[Key, Entered]]
) -> Network:
    """The clicked balls and landmarks of all pulses as a network, with an image for each camera at each pulse.

    Of pictures of a frame of targets `svev calibrate` makes the interior orientations from it (paper, step 1).

    Args:
        sizes: width and height of the images by camera, px.
        survey: of the balls, or of the frame's targets; has the cameras.
        marks: of a person. Landmarks that are none of its points are tie points.
    """
    placed, _ = survey.cameras_of(sizes)
    cameras, points = list(placed), list(survey.network.points)
    names = {point.name: i for i, point in enumerate(points)}
    images: dict[tuple[str, int], int] = {}
    rows = []
    for key, entered in marks:
        name = ball_of(key.thing) or (key.thing.removeprefix(LANDMARK) if key.thing.startswith(LANDMARK) else None)
        if name is None or key.camera not in placed or entered.state is not MarkState.MEASURED or not entered.xy:
            continue
        if name not in names:
            names[name] = len(points)
            points.append(Point(name, Role.TIE))
        image = images.setdefault((key.camera, key.pulse), len(images))
        rows.append((image, names[name], entered))
    return replace(
        survey.network,
        cameras=tuple(placed.values()),
        images=tuple(Image(f"{name} pulse {pulse}", cameras.index(name)) for name, pulse in images),
        points=tuple(points),
        observations=_observations(rows, [sizes[name] for name, _ in images]),
    )


def _observations(rows: Sequence[tuple[int, int, Entered]], sizes: Sequence[tuple[int, int]]) -> ImageObservations:
    """Marks as observations.

    Args:
        rows: image, point and mark.
        sizes: of each image, px.
    """
    xy = [pixel_to_metric(np.array(entered.xy, float), np.array(sizes[i], float)) for i, _, entered in rows]
    return ImageObservations(
        np.array([i for i, _, _ in rows], np.intp),
        np.array([p for _, p, _ in rows], np.intp),
        np.array(xy, float).reshape(-1, 2),
        np.array([sigma_of(entered) for _, _, entered in rows], float).reshape(-1, 2),
        np.zeros(len(rows), np.intp),
    )
