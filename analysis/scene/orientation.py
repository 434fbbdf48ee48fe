"""Orients the cameras of a log from the balls in its own images and the survey: the paper's step 2, without a hand.

Static images, detection, names by geometry, tie balls, then the network with all measurements and the three stages of
the search for gross errors (`photogrammetry.procedures.orientation`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import radians
from pathlib import Path

import numpy as np
from scipy.special import chdtri

from analysis.scene.detection import Detections, detect_balls
from analysis.scene.hypotheses import Approximate
from analysis.scene.lit_balls import with_lit_balls, with_scatter
from analysis.scene.measured_network import View, measured_network
from analysis.scene.naming import Naming, NotNamedError, Spots, name_balls
from analysis.scene.reflection import with_better_pose
from analysis.scene.sought_balls import with_sought_balls
from analysis.scene.static_image import StaticImage, static_images
from analysis.scene.survey import KnownPoints, Survey
from analysis.scene.ties import Station, Tie, ball_size, find_ties
from analysis.scene.units import check_lengths
from photogrammetry.network.file import pixel_to_metric
from photogrammetry.network.model import Camera, Image, Network, Role
from photogrammetry.procedures.orientation import Orientation, orient
from rig.arrays import Floats
from rig.errors import BadInputError
from rig.phrase import Phrase, phrase
from rig.phrases import in_turn

_FEWEST_CAMERAS = 2
#: How far off an approximate pose may be that says nothing about it: part of the distance to the balls, and an angle.
_OFF_DISTANCE, _OFF_ANGLE = 0.1, radians(8.0)
_SIGMAS = 4.0  # of an approximate pose that says how good it is
_MISFIT_RISK = 1e-4  # chance that sound data are reported not to fit
_MIRROR = np.array([1.0, -1.0])  # pixel frame to metric frame


@dataclass(frozen=True, slots=True, eq=False)
class OrientedCamera:
    """The pose of a camera.

    Attributes:
        name: of the camera.
        position: (3,) X0.
        rotation: (3, 3), columns are the camera's axes.
        covariance: (6, 6) a posteriori, of X0 and of turns about the camera's own axes (rad).
    """

    name: str
    position: Floats
    rotation: Floats
    covariance: Floats


@dataclass(frozen=True, slots=True, eq=False)
class Ball:
    """A ball.

    Attributes:
        name: in the survey, or T1, T2, ...
        role: in the adjustment.
        xyz: (3,) adjusted coordinates.
        sigma: (3,) a posteriori.
        images: per camera (4,) x, y, sigma x, sigma y in the pixel frame.
    """

    name: str
    role: Role
    xyz: Floats
    sigma: Floats
    images: Mapping[str, Floats]


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """Oriented cameras and balls of a log.

    Attributes:
        cameras: by name.
        balls: by name.
        network: everything that was measured, as `svev orient` takes it.
        orientation: the adjustment with its three stages; holds the joint covariance of all poses.
        static: the static images.
        failures: cameras that could not be oriented, and why.
        messages: what a person should know.
    """

    cameras: Mapping[str, OrientedCamera]
    balls: Mapping[str, Ball]
    network: Network
    orientation: Orientation
    static: Mapping[str, StaticImage]
    failures: Mapping[str, Phrase]
    messages: tuple[Phrase, ...]


def orient_log(log: Path, survey: Survey, pulses: range | None = None) -> Scene:
    """Orient the cameras of a log.

    Args:
        log: the log.
        survey: balls and interior orientations.
        pulses: use only these; all if left out.

    Raises:
        BadInputError: the survey does not belong to the log (other image size), or fewer than two cameras can be
            oriented; the message says why for each.
        LogDamagedError: the log has no images there, or damaged ones.
        NotSolvableError, NotConvergedError: of the adjustment.
    """
    return orient_images(static_images(log, pulses), survey)


def orient_images(
    static: Mapping[str, StaticImage], survey: Survey, detections: Mapping[str, Detections] | None = None
) -> Scene:
    """Orient cameras from their static images; see `orient_log`.

    Args:
        static: the static images.
        survey: balls and interior orientations.
        detections: what `detect_balls` finds in them, if that is known already.
    """
    cameras, strange = survey.cameras_of({name: image.size for name, image in static.items()})
    if len(strange) > 1 and not cameras:
        raise BadInputError(survey.lacks_all(tuple(strange)))
    known = survey.surveyed()
    found = detections or {name: detect_balls(image) for name, image in static.items()}
    views = {name: _view(camera, found[name], survey, known) for name, camera in cameras.items()}
    namings, failures = _named(views, known)
    ties = _ties(views, namings, known, survey.source)
    if failures and len(namings) >= _FEWEST_CAMERAS:
        more, failures = _named({name: views[name] for name in failures}, _with_ties(known, ties))
        if more:
            surveyed = len(known.names)
            namings |= {name: _only_first(naming, surveyed) for name, naming in more.items()}
            ties = _ties(views, namings, known, survey.source)
    if len(namings) < _FEWEST_CAMERAS:
        if not namings and views and _fits_mirrored(next(iter(views.values())), known):  # one tells, and takes seconds
            raise BadInputError(
                phrase(
                    "survey_mirrored",
                    "{source}: the images show the surveyed balls as in a mirror: its axes are left-handed, as where "
                    "north stands before east; interchange two columns of the coordinates, or change the sign of one",
                    source=survey.source,
                )
            )
        reasons = [
            phrase("camera_unnamed", "camera {camera}: {why}", camera=name, why=reason)
            for name, reason in failures.items()
        ]
        alone = phrase(
            "survey_one_camera",
            "{source}: the log has one camera; two at least are needed to measure in space",
            source=survey.source,
        )
        raise BadInputError(in_turn([*strange.values(), *reasons] or [alone]))
    network, notes = measured_network(views, namings, ties, survey, known)
    orientation = orient(network, uncertain_interior=True)
    lit = with_lit_balls(network, orientation, static, found)
    lit = with_sought_balls(lit, orient(lit.network, uncertain_interior=True), static, survey)
    network = with_scatter(lit.network, orient(lit.network, uncertain_interior=True))
    orientation = orient(network, uncertain_interior=True)
    if len(orientation.outcome.adjustment.network.images) < _FEWEST_CAMERAS:
        raise BadInputError(in_turn(orientation.left_out))
    failures = strange | failures
    messages = [
        phrase("scene_not_oriented", "camera {camera} is not oriented: {why}", camera=name, why=reason)
        for name, reason in failures.items()
    ]
    missing = [camera.name for camera in survey.network.cameras if camera.name not in static]
    messages += [
        phrase("scene_no_image", "camera {camera} of the survey has no image in the log", camera=name)
        for name in missing
    ]
    messages += [*notes, *orientation.left_out, *_misfit(orientation), *lit.messages]
    messages += [finding.said for stage in orientation.stages for finding in stage.findings]
    return scene_of(network, orientation, static, failures, messages)


def _view(camera: Camera, detections: Detections, survey: Survey, known: KnownPoints) -> View:
    mirror = np.outer(_MIRROR, _MIRROR)
    spots = Spots(pixel_to_metric(detections.xy, np.array(camera.size, float)), detections.covariance * mirror)
    return View(camera, detections, spots, _approximate(survey.image(camera.name), known))


def _approximate(image: Image | None, known: KnownPoints) -> Approximate | None:
    """How far the approximate pose of a survey can be trusted."""
    if image is None or image.position is None or image.rotation is None:
        return None
    distance = float(np.linalg.norm(image.position - known.xyz.mean(axis=0)))
    off, angle = _OFF_DISTANCE * distance, _OFF_ANGLE
    if image.sigma_position is not None:
        off = _SIGMAS * float(np.linalg.norm(image.sigma_position))
    if image.sigma_angles is not None:
        angle = _SIGMAS * float(np.linalg.norm(image.sigma_angles))
    return Approximate(image.position, image.rotation, off, angle)


def _named(views: Mapping[str, View], known: KnownPoints) -> tuple[dict[str, Naming], dict[str, Phrase]]:
    """Names per camera, and why there are none."""
    namings: dict[str, Naming] = {}
    failures: dict[str, Phrase] = {}
    for name, view in views.items():
        try:
            namings[name] = _named_view(view, known)
        except NotNamedError as error:
            failures[name] = error.said
    return namings, failures


def _named_view(view: View, known: KnownPoints) -> Naming:
    """Names near the approximate pose, which also decides between two poses; if there are none, without it."""
    if view.approximate is not None:
        try:
            return name_balls(view.camera, view.spots, known, view.approximate)
        except NotNamedError:
            pass  # the approximate pose may be worse than it says: the balls decide
    return with_better_pose(name_balls(view.camera, view.spots, known), view.camera, view.spots, known)


def _only_first(naming: Naming, n: int) -> Naming:
    """The naming without the points from index n on."""
    first = naming.points < n
    return replace(naming, points=naming.points[first], spots=naming.spots[first])


def _with_ties(known: KnownPoints, ties: Sequence[Tie]) -> KnownPoints:
    if not ties:
        return known
    names = tuple(f"tie {i}" for i in range(len(ties)))
    return known.joined(KnownPoints(names, np.array([t.xyz for t in ties]), np.array([t.covariance for t in ties])))


def _stations(views: Mapping[str, View], namings: Mapping[str, Naming]) -> list[Station]:
    return [
        Station(
            views[name].camera,
            naming.pose,
            views[name].spots,
            views[name].detections.radius,
            np.setdiff1d(np.arange(0 if naming.doubtful else len(views[name].spots)), naming.spots),
        )
        for name, naming in namings.items()
    ]


def _fits_mirrored(view: View, known: KnownPoints) -> bool:
    """Whether the balls that an image shows are the surveyed ones in a mirror."""
    try:
        name_balls(view.camera, view.spots, known.mirrored())
    except NotNamedError:
        return False
    return True


def _ties(views: Mapping[str, View], namings: Mapping[str, Naming], known: KnownPoints, source: str) -> list[Tie]:
    """Balls without coordinates that several images show; refuses a survey that is not in metres."""
    if len(namings) < _FEWEST_CAMERAS:
        return []
    stations = _stations(views, namings)
    named = [
        (station, int(spot), known.xyz[point])
        for station, naming in enumerate(namings.values())
        for point, spot in zip(naming.points, naming.spots, strict=True)
    ]
    size = ball_size(stations, named)
    check_lengths(size, source)
    return find_ties(stations, size)


def _misfit(orientation: Orientation) -> list[Phrase]:
    """What to say if residuals are larger than their sigmas explain, which gross errors of single balls do not do."""
    a = orientation.outcome.adjustment
    if a.redundancy < 1 or a.ratio**2 * a.redundancy < chdtri(a.redundancy, _MISFIT_RISK):
        return []
    o = a.network.observations
    squares = (a.image_residuals() / o.sigma) ** 2
    rms = {image.name: float(np.sqrt(squares[o.image == i].mean())) for i, image in enumerate(a.network.images)}
    words = ", ".join(f"{name} {value:.1f}" for name, value in rms.items())
    text = (
        "the residuals are {ratio:.1f} times as large as their sigmas say (image points, by camera: {cameras}); the "
        "sigmas of the result are larger by as much; check the interior orientations and the sigmas of the survey"
    )
    return [phrase("scene_misfit", text, ratio=a.ratio, cameras=words)]


def scene_of(
    network: Network,
    orientation: Orientation,
    static: Mapping[str, StaticImage],
    failures: Mapping[str, Phrase],
    messages: Sequence[Phrase],
) -> Scene:
    """The scene of an oriented network with one image of each camera."""
    a = orientation.outcome.adjustment
    unknowns = a.problem.unknowns
    cameras = {
        image.name: OrientedCamera(image.name, a.state.position[i], a.state.rotation[i], a.covariance(unknowns.pose[i]))
        for i, image in enumerate(a.network.images)
    }
    sigma = a.sigmas(unknowns.point)
    balls = {
        point.name: Ball(point.name, point.role, a.state.xyz[i], sigma[i], _measured(network, point.name))
        for i, point in enumerate(a.network.points)
    }
    return Scene(cameras, balls, network, orientation, static, failures, tuple(messages))


def _measured(network: Network, name: str) -> dict[str, Floats]:
    """Where the images show a point, pixel frame, with sigmas."""
    o = network.observations
    place = [point.name for point in network.points].index(name)
    found = {}
    for row in np.flatnonzero(o.point == place):
        image = network.images[int(o.image[row])]
        size = np.array(network.cameras[image.camera].size, float)
        found[image.name] = np.concatenate((o.xy[row] * _MIRROR + (size - 1) / 2, o.sigma[row]))
    return found
