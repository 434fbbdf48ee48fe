"""Builds the network of the balls that were named and found: points, observations with sigma, start values."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain, count

import numpy as np

from analysis.scene.detection import Detections
from analysis.scene.hypotheses import Approximate
from analysis.scene.naming import Naming, Spots
from analysis.scene.survey import KnownPoints, Survey
from analysis.scene.ties import Tie
from photogrammetry.network.model import Camera, Image, ImageObservations, Network, Point, Role
from rig.phrase import Phrase, phrase

_SURVEY_OFF = 0.04  # of the survey's extent: a ball without a name may be a surveyed point so far from it


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """What one camera shows.

    Attributes:
        camera: its interior orientation.
        detections: in the pixel frame.
        spots: the same in the metric frame.
        approximate: its pose as the survey gives it, if it does.
    """

    camera: Camera
    detections: Detections
    spots: Spots
    approximate: Approximate | None


#: The detection that shows a point in a camera.
_Seen = dict[tuple[str, str], int]


def measured_network(
    views: Mapping[str, View], namings: Mapping[str, Naming], ties: Sequence[Tie], survey: Survey, known: KnownPoints
) -> tuple[Network, list[Phrase]]:
    """The network of everything that was measured.

    Args:
        views: all cameras.
        namings: of the cameras that are oriented; their order is that of the images.
        ties: balls without a name, with rays by index of naming.
        survey: gives points and cameras.
        known: the surveyed balls, as `namings` counts them.

    Returns:
        The network, with poses where the survey gives approximate ones, and what there is to say.
    """
    given = {point.name: point for point in survey.network.points}
    points: dict[str, Point] = {}
    seen: _Seen = {}
    for camera, naming in namings.items():
        for index, spot in zip(naming.points, naming.spots, strict=True):
            ball = known.names[index]
            points[ball] = given[ball]
            seen[camera, ball] = int(spot)
    free = [p for p in survey.network.points if p.xyz is not None and p.name not in points]
    near, notes = _nearest_points(ties, free, known, survey.network.length_unit)
    names = _names(survey, {point.name for point in near.values()})
    cameras = list(namings)
    for i, tie in enumerate(ties):
        point = near[i] if i in near else Point(next(names), Role.TIE, tie.xyz)
        points[point.name] = point
        seen |= {(cameras[station], point.name): spot for station, spot in tie.rays.items()}
    order = {name: i for i, name in enumerate(given)}
    chosen = tuple(sorted(points.values(), key=lambda point: order.get(point.name, len(order))))
    network = replace(
        survey.network,
        cameras=tuple(views[name].camera for name in cameras),
        images=tuple(_image(i, views[name], namings[name], survey) for i, name in enumerate(cameras)),
        points=chosen,
        observations=_observations([views[name].spots for name in cameras], cameras, chosen, seen),
        distances=(),
        differences=(),
    )
    return network, notes + _counts(views, namings, seen, points, known)


def _observations(
    spots: Sequence[Spots], cameras: Sequence[str], points: Sequence[Point], seen: _Seen
) -> ImageObservations:
    place = {point.name: i for i, point in enumerate(points)}
    rows = sorted((cameras.index(camera), place[ball], spot) for (camera, ball), spot in seen.items())
    image, point = (np.array([row[k] for row in rows], np.intp) for k in (0, 1))
    xy = np.array([spots[i].xy[spot] for i, _, spot in rows], float).reshape(-1, 2)
    variance = np.array([np.diagonal(spots[i].covariance[spot]) for i, _, spot in rows], float).reshape(-1, 2)
    return ImageObservations(image, point, xy, np.sqrt(variance), np.zeros(len(rows), np.intp))


def _image(index: int, view: View, naming: Naming, survey: Survey) -> Image:
    """The image of a camera; an approximate pose with a sigma stays a weighted observation.

    Without an approximate pose there is none: what the balls of one image say of it, the adjustment finds out itself,
    and a pose that is given counts as evidence where the balls do not decide between two.
    """
    camera = view.camera.name
    given = survey.image(camera)
    if given is not None and (given.sigma_position is not None or given.sigma_angles is not None):
        return replace(given, name=camera, camera=index)
    pose = naming.pose
    if view.approximate is None or not view.approximate.admits(pose.position[None], pose.rotation[None])[0]:
        return Image(camera, index)
    return Image(camera, index, pose.position, pose.rotation)


def _nearest_points(
    ties: Sequence[Tie], points: Sequence[Point], known: KnownPoints, unit: str
) -> tuple[dict[int, Point], list[Phrase]]:
    """Which ties are points of the survey whose coordinates are approximate or wrong; surveyed ones are reported."""
    if not points or not ties:
        return {}, []
    limit = _SURVEY_OFF * float(np.linalg.norm(np.ptp(known.xyz, axis=0)))
    there = np.array([point.xyz for point in points], float)
    off = np.array([tie.xyz for tie in ties], float)[:, None] - there
    distance = np.linalg.norm(off, axis=2)
    chosen: dict[int, Point] = {}
    notes: list[Phrase] = []
    for i, j in enumerate(distance.argmin(axis=1)):
        if distance[i, j] > limit or distance[:, j].argmin() != i:
            continue
        chosen[i] = points[int(j)]
        if chosen[i].role not in {Role.TIE, Role.CHECK}:
            words = ", ".join(f"{value:+.3f}" for value in off[i, j])
            text = (
                "the images show a ball at {ball} + ({off}) {unit} and none at its surveyed coordinates; survey it "
                "again"
            )
            notes.append(phrase("scene_ball_beside", text, ball=chosen[i].name, off=words, unit=unit))
    return chosen, notes


def _names(survey: Survey, taken: set[str]) -> Iterator[str]:
    """Names for balls that nobody surveyed: those that the survey holds ready, then T1, T2, ... as far as free."""
    used = {point.name for point in survey.network.points}
    ready = [p.name for p in survey.network.points if p.role is Role.TIE and p.xyz is None and p.name not in taken]
    return chain(ready, (name for name in (f"T{i}" for i in count(1)) if name not in used))


def _counts(
    views: Mapping[str, View],
    namings: Mapping[str, Naming],
    seen: _Seen,
    points: Mapping[str, Point],
    known: KnownPoints,
) -> list[Phrase]:
    notes = [
        phrase(
            "scene_counts",
            "camera {camera}: {named} of {expected} surveyed balls in sight named, {measured} balls measured, {spots} "
            "round spots found",
            camera=name,
            named=len(naming.points),
            expected=naming.expected,
            measured=sum(camera == name for camera, _ in seen),
            spots=len(views[name].spots),
        )
        for name, naming in namings.items()
    ]
    lost = ", ".join(ball for ball in known.names if ball not in points)
    return (
        [*notes, phrase("scene_balls_lost", "surveyed balls found in no image: {balls}", balls=lost)] if lost else notes
    )
