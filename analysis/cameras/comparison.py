"""Compares the balls of a log with a calibration: finds them, says how far each camera is from where it stood.

The poses stay those of the calibration. Its balls are looked for at the places where it showed them, all of one camera
displaced alike at most; that chance makes so many of them agree must be out of the question.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import comb, pi

import numpy as np

from analysis.cameras.oriented_scene import OrientedScene, displacements
from analysis.cameras.pose_change import FEWEST, PoseChange, pose_change
from analysis.cameras.poses_file import Calibration
from analysis.scene.camera_system import CameraSystem, PlacedCamera
from analysis.scene.detection import Detections, detect_balls
from analysis.scene.lit_balls import measure_balls
from analysis.scene.naming import MODEL_SIGMA
from analysis.scene.orientation import Ball
from analysis.scene.static_image import StaticImage
from photogrammetry.network.file import pixel_to_metric
from photogrammetry.network.model import Image, ImageFrame, ImageObservations, Network, Point, Role
from rig.arrays import Floats
from rig.errors import BadInputError
from rig.phrase import Phrase, phrase

_ALIKE = 0.005  # of the image's width: balls displaced alike differ by less, also where the camera rolled a little
_CHANCE = 1e-3  # that balls agree although they are others
_ROUNDS_MOST = 4
_FEWEST_CAMERAS = 2


@dataclass(frozen=True, slots=True, eq=False)
class _Match:
    """The balls of one camera.

    Attributes:
        seen: by name (4,) x, y, sigma x, sigma y in the log's static image; also of balls that do not agree.
        change: of the pose, from the calibration to the static image.
    """

    seen: Mapping[str, Floats]
    change: PoseChange


def scene_of_calibration(
    static: Mapping[str, StaticImage], calibration: Calibration, detections: Mapping[str, Detections] | None = None
) -> OrientedScene:
    """The cameras of a log as a calibration has them, compared with the balls that the log shows.

    Args:
        static: static images of the log.
        calibration: result of `svev orient`.
        detections: what `detect_balls` finds in them, if that is known already.

    Raises:
        BadInputError: the calibration does not belong to these cameras: one is missing, the image size is another, or
            the balls are elsewhere in every camera.
    """
    system, notes = calibration.of_images({name: image.size for name, image in static.items()})
    matches: dict[str, _Match] = {}
    found: dict[str, Detections] = {}
    elsewhere = []
    for name in system.names:
        places = _places(system[name], calibration)
        if len(places) < FEWEST:
            text = "camera {camera}: {source} holds too few image points of balls to compare it with"
            notes.append(phrase("poses_few_points", text, camera=name, source=calibration.source))
            continue
        found[name] = detections[name] if detections else detect_balls(static[name])
        match = _matched(system[name], places, calibration, found[name])
        if match is None:
            elsewhere.append(name)
        else:
            matches[name] = match
            text = "camera {camera}: {found} of {balls} balls of the calibration found"
            used_balls = len(match.change.used)
            notes.append(phrase("poses_balls_found", text, camera=name, found=used_balls, balls=len(places)))
    matches, light = _in_one_light(system, matches, calibration, static, found)
    used = tuple(name for name in system.names if name not in elsewhere)
    notes += [*light, *_verdict(calibration, used, elsewhere), *_moved_balls(matches)]
    balls = _balls(calibration, matches)
    changes = {name: match.change for name, match in matches.items()}
    chosen = system.only(used)
    network = _network(chosen, calibration, balls)
    return OrientedScene(chosen, balls, network, static, changes, (*calibration.messages, *notes))


def _verdict(calibration: Calibration, used: Sequence[str], elsewhere: Sequence[str]) -> list[Phrase]:
    """What there is to say of cameras whose balls are elsewhere.

    Raises:
        BadInputError: fewer than two cameras are left.
    """
    if len(used) < _FEWEST_CAMERAS:
        if not elsewhere:
            raise BadInputError(
                phrase(
                    "poses_one_camera",
                    "the log has one camera, {camera}; two at least are needed to measure in space",
                    camera=used[0],
                )
            )
        if not used:
            raise BadInputError(
                phrase(
                    "poses_all_elsewhere",
                    "{source}: in no camera are the balls where this calibration has them; name the calibration of "
                    "these cameras on this hill, or orient the log with --survey",
                    source=calibration.source,
                )
            )
        raise BadInputError(
            phrase(
                "poses_elsewhere",
                "{source}: the balls of {cameras} are not where this calibration has them; name the calibration of "
                "these cameras on this hill, or orient the log with --survey",
                source=calibration.source,
                cameras=" and ".join(elsewhere),
            )
        )
    text = (
        "camera {camera} is left out: its balls are not where {source} has them, so it was turned far, or its balls "
        "are covered; orient the log with --survey"
    )
    return [phrase("poses_left_out", text, camera=name, source=calibration.source) for name in elsewhere]


def _moved_balls(matches: Mapping[str, _Match]) -> list[Phrase]:
    """Balls that several cameras show elsewhere than the calibration, when what the cameras moved is accounted for."""
    gone = [ball for match in matches.values() for ball in match.change.left_out]
    text = "ball {ball} is not where the calibration has it (cameras {cameras}); it was moved, survey it again"
    return [
        phrase("poses_ball_moved", text, ball=ball, cameras=", ".join(where))
        for ball in dict.fromkeys(gone)
        if len(where := [name for name, match in matches.items() if ball in match.change.left_out]) > 1
    ]


def _places(placed: PlacedCamera, calibration: Calibration) -> dict[str, Floats]:
    """Where the calibration measured balls in a camera's image: (4,) x, y, sigma x, sigma y."""
    places = {}
    for name, ball in calibration.balls.items():
        if placed.name in ball.images:
            residual = ball.images[placed.name]
            places[name] = np.concatenate((placed.project(ball.xyz) - residual[:2], residual[2:]))
    return places


def _matched(
    placed: PlacedCamera, places: Mapping[str, Floats], calibration: Calibration, found: Detections
) -> _Match | None:
    """The balls of a camera in the log; None if no displacement makes enough of them agree."""
    names = list(places)
    there = np.array([places[name] for name in names])
    xyz = {name: calibration.balls[name].xyz for name in names}
    pairs = _alike(there[:, :2], found.xy, placed.size)
    change = None
    for _ in range(_ROUNDS_MOST):
        if len(pairs) < FEWEST:
            return None
        after = {
            names[i]: np.concatenate((found.xy[j], np.sqrt(np.diagonal(found.covariance[j])))) for i, j in pairs.items()
        }
        change = pose_change(placed, displacements(places, after, xyz, MODEL_SIGMA))
        if change is None:
            return None
        before, pairs = pairs, _near(change.applied(placed), placed, there, np.array(list(xyz.values())), found)
        if pairs == before:
            break
    if change is None or not _is_convincing(len(change.used), len(names), found, placed.size):
        return None
    return _Match(after, change)


def _in_one_light(
    system: CameraSystem,
    matches: Mapping[str, _Match],
    calibration: Calibration,
    static: Mapping[str, StaticImage],
    found: Mapping[str, Detections],
) -> tuple[dict[str, _Match], list[Phrase]]:
    """Balls measured as lit spheres, as those of the calibration were, without those that moved; words on the light."""
    names = list(matches)
    rows = [(k, ball, place) for k, name in enumerate(names) for ball, place in matches[name].seen.items()]
    if not rows:
        return {}, []
    camera = np.array([k for k, _, _ in rows], np.intp)
    xyz = np.array([calibration.balls[ball].xyz for _, ball, _ in rows])
    disc = np.array([place[:2] for _, _, place in rows])
    placed = [system[name] for name in names]
    measured = measure_balls(placed, static, found, camera, xyz, disc, calibration.ball_radius_m)
    lit: dict[str, _Match] = {}
    for k, name in enumerate(names):
        after = {
            rows[i][1]: np.concatenate((measured.xy[i], measured.sigma[i]))
            for i in np.flatnonzero(camera == k).tolist()
        }
        places = _places(system[name], calibration)
        of_balls = {ball: calibration.balls[ball].xyz for ball in places}
        change = pose_change(system[name], displacements(places, after, of_balls, MODEL_SIGMA)) or matches[name].change
        lit[name] = _Match({ball: after[ball] for ball in change.used}, change)
    return lit, measured.messages(camera, names, [ball for _, ball, _ in rows])


def _alike(there: Floats, found: Floats, size: Floats) -> dict[int, int]:
    """Balls and detections for the displacement at which most of them meet; the smallest of equally good ones."""
    if not len(found):
        return {}
    limit = _ALIKE * float(size[0])
    off = found[None] - there[:, None]
    candidates = off.reshape(-1, 2)
    distance = np.linalg.norm(off[None] - candidates[:, None, None], axis=3)
    met = (distance.min(axis=2) < limit).sum(axis=1)
    best = min(range(len(candidates)), key=lambda i: (-int(met[i]), float(np.hypot(*candidates[i]))))
    return _mutual(distance[best], np.full(distance.shape[1:], limit))


def _near(now: PlacedCamera, placed: PlacedCamera, there: Floats, xyz: Floats, found: Detections) -> dict[int, int]:
    """Balls and detections near where a changed pose puts them; which of them agree is found out later."""
    predicted = there[:, :2] + now.project(xyz) - placed.project(xyz)
    distance = np.linalg.norm(found.xy[None] - predicted[:, None], axis=2)
    return _mutual(np.nan_to_num(distance, nan=np.inf), np.full(distance.shape, _ALIKE * float(placed.size[0])))


def _mutual(distance: Floats, limit: Floats) -> dict[int, int]:
    nearest, back = distance.argmin(axis=1), distance.argmin(axis=0)
    return {i: int(j) for i, j in enumerate(nearest) if back[j] == i and distance[i, j] < limit[i, j]}


def _is_convincing(agreeing: int, balls: int, found: Detections, size: Floats) -> bool:
    """Whether chance would not make so many balls agree at any of the displacements that were possible."""
    if agreeing < FEWEST:
        return False
    share = min(1.0, len(found) * pi * (_ALIKE * size[0]) ** 2 / float(size.prod()))
    tried = balls * max(1, len(found))
    return bool(tried * comb(balls - 1, agreeing - 1) * share ** (agreeing - 1) < _CHANCE)


def _balls(calibration: Calibration, matches: Mapping[str, _Match]) -> dict[str, Ball]:
    balls = {}
    for name, ball in calibration.balls.items():
        images = {camera: match.seen[name] for camera, match in matches.items() if name in match.seen}
        role = Role.CONTROL if ball.surveyed else Role.TIE
        if images:
            balls[name] = Ball(name, role, ball.xyz, np.sqrt(np.diagonal(ball.covariance)), images)
    return balls


def _network(system: CameraSystem, calibration: Calibration, balls: Mapping[str, Ball]) -> Network:
    """What the log shows of the balls, with coordinates and poses of the calibration as weighted observations."""
    images = []
    for i, name in enumerate(system.names):
        placed = system[name]
        sigma = np.sqrt(np.diagonal(system.covariance)[placed.columns[:6]])
        known = bool((sigma > 0).all())
        weights = (sigma[:3], sigma[3:]) if known else (None, None)
        images.append(Image(name, i, placed.position, placed.rotation, known, *weights))
    points = []
    for name, ball in balls.items():
        sound = bool((ball.sigma > 0).all())
        points.append(Point(name, Role.CONTROL if sound else Role.FIXED, ball.xyz, ball.sigma if sound else None))
    order = {name: i for i, name in enumerate(balls)}
    rows = [
        (i, order[ball.name], ball.images[camera])
        for i, camera in enumerate(system.names)
        for ball in balls.values()
        if camera in ball.images
    ]
    sizes = np.array([system[system.names[i]].size for i, _, _ in rows], float).reshape(-1, 2)
    values = np.array([row[2] for row in rows], float).reshape(-1, 4)
    observations = ImageObservations(
        np.array([row[0] for row in rows], np.intp),
        np.array([row[1] for row in rows], np.intp),
        pixel_to_metric(values[:, :2], sizes),
        values[:, 2:],
        np.zeros(len(rows), np.intp),
    )
    return Network(
        cameras=tuple(system[name].camera for name in system.names),
        images=tuple(images),
        points=tuple(points),
        observations=observations,
        length_unit=calibration.length_unit,
        image_frame=ImageFrame.PIXEL,
    )
