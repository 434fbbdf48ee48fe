"""The five pictures: the jumper at fixed places, cut out of the camera that sees him best, all at the same scale."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import Final

import cv2
import numpy as np

from analysis.cameras.frames import camera_images
from analysis.measurements.model import ImageMeasurements, JumpMeasurements
from analysis.report.course import Course, best_state
from analysis.report.frames import Grey, frames_of
from analysis.report.overlay import Overlay, overlay_of
from analysis.scene.camera_system import CameraSystem, PlacedCamera
from rig.arrays import Floats

#: Distances from the take-off, horizontal and along the flight, m.
PLACES_M: Final = (0.0, 5.0, 10.0, 15.0, 20.0)
#: Size of a picture, px.
WIDTH, HEIGHT = 516, 387
_MARGIN_FACTOR: Final = 1.2  # around the largest of the five: helmet and hands reach beyond the marked points
_BESIDE: Final = 24  # grey value beside an image
_DARK, _LIT = 0.15, 0.3  # of white: pictures with a darker middle grey are brightened, to this one
_STRONGEST: Final = 0.4  # power of a curve: a stronger one would show little but noise
_UNEVEN: Final = 1.1  # the way from pulse to pulse changes by less than a tenth in a jump


class Missing(StrEnum):
    """Why there is no picture of a place."""

    NOT_MEASURED = "not measured"  #: the measured motion does not reach there
    NO_PICTURE = "no picture"  #: no camera delivered a frame at that pulse that shows him


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """The pulse that is nearest to a place.

    Attributes:
        place_m: the place.
        index: of the pulse in the course.
        pulse: its number.
        since_s: after the take-off.
        distance_m: where he really is then.
    """

    place_m: float
    index: int
    pulse: int
    since_s: float
    distance_m: float


@dataclass(frozen=True, slots=True, eq=False)
class Shot:
    """The picture of a place.

    Attributes:
        place_m: the place.
        missing: why there is none; the rest is None then but for `moment`, which is None where nothing was measured.
        moment: the pulse.
        camera: whose image it is.
        picture: (HEIGHT, WIDTH) grey values.
        overlay: in px of the picture; (0, 0) is the centre of its first pixel.
        px_per_m: scale at the jumper; the same in all pictures of a jump.
    """

    place_m: float
    missing: Missing | None
    moment: Moment | None = None
    camera: str | None = None
    picture: Grey | None = None
    overlay: Overlay | None = None
    px_per_m: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class _View:
    """The jumper in the image of one camera: the image, what is drawn over it, and px in a metre at his place."""

    camera: str
    image: Grey
    overlay: Overlay
    scale: float
    rank: tuple[bool, int, float]


def moments_of(course: Course) -> list[Moment | None]:
    """For each of `PLACES_M` the nearest pulse, by the smoothed motion relative to the measured take-off.

    None where the motion was not measured as far as that, or has a gap there: no pulse lies within half of the way
    that he flies from pulse to pulse.
    """
    measured = np.array([pulse.smoothed is not None for pulse in course.pulses], bool)
    known = np.flatnonzero(measured & np.isfinite(course.distance))
    if course.takeoff_sigma_s is None or len(known) < 2 or not course.since[known[0]] <= 0 <= course.since[known[-1]]:
        return [None] * len(PLACES_M)
    periods = np.diff(course.since)
    step = float(np.median(np.diff(course.distance[known]) / np.diff(course.since[known])) * np.median(periods))
    return [_moment(course, known, place, step) for place in PLACES_M]


def shots_of(course: Course, measured: JumpMeasurements | None, system: CameraSystem, log: Path) -> list[Shot]:
    """The pictures of a jump, one for each of `PLACES_M`.

    Of the cameras with a frame of that pulse in which the middle of the jumper lies, the best is: first one with the
        whole jumper, then one with most of his points and skis measured, then the one that shows him largest.

    Args:
        course: of the jump.
        measured: what was measured in its images.
        system: the oriented cameras.
        log: where the images are.

    Raises:
        BadInputError: the log cannot be read.
    """
    moments = moments_of(course)
    images = _images(log, {moment.pulse for moment in moments if moment is not None})
    by_pulse: dict[int, Mapping[str, ImageMeasurements]] = {}
    if measured is not None:
        by_pulse = {int(pulse.pulse): pulse.images for pulse in measured.pulses}
    views = []
    for moment in moments:
        of_pulse = {} if moment is None else by_pulse.get(moment.pulse, {})
        views.append(None if moment is None else _best(course, moment, images.get(moment.pulse, {}), of_pulse, system))
    width_m = _width_m([view for view in views if view is not None])
    shots = [_shot(place, moment, view, width_m) for place, moment, view in zip(PLACES_M, moments, views, strict=True)]
    return brightened(shots)


def brightened(shots: Sequence[Shot]) -> list[Shot]:
    """The same pictures, brighter if they are very dark: all by one curve, so that they still compare.

    The curve is a power: black stays black and white white, so that markers which shine in the dark are not lost in it.
    """
    pictures = [shot.picture for shot in shots if shot.picture is not None]
    middle = float(np.median(np.concatenate([picture.ravel() for picture in pictures]))) / 255 if pictures else 1.0
    if middle >= _DARK:
        return list(shots)
    power = max(_STRONGEST, float(np.log(_LIT) / np.log(max(middle, 1 / 255))))
    curve = np.rint(255 * np.linspace(0, 1, 256) ** power).astype(np.uint8)
    return [shot if shot.picture is None else replace(shot, picture=curve[shot.picture]) for shot in shots]


def _moment(course: Course, known: np.ndarray, place: float, step: float) -> Moment | None:
    off = np.abs(course.distance[known] - place)
    if not off.min() <= abs(step) / 2 * _UNEVEN:
        return None
    index = int(known[off.argmin()])
    pulse = course.pulses[index]
    return Moment(place, index, int(pulse.pulse), float(course.since[index]), float(course.distance[index]))


def _images(log: Path, pulses: set[int]) -> dict[int, dict[str, Grey]]:
    """The frames of some pulses by camera."""
    return {
        int(tag.pulse): {name: own.copy() for name, own in camera_images(tag, image).items()}
        for tag, image in frames_of(log, pulses)
    }


def _best(
    course: Course,
    moment: Moment,
    images: Mapping[str, Grey],
    measured: Mapping[str, ImageMeasurements],
    system: CameraSystem,
) -> _View | None:
    state = best_state(course.pulses[moment.index])
    points = [point.xyz for point in state.points.values() if point is not None]
    if not points:
        return None
    middle = np.mean(points, axis=0)
    views = []
    for name, camera in system.cameras.items():
        image, own = images.get(name), measured.get(name)
        overlay = overlay_of(state, own, camera)
        places = overlay.places()
        if image is None or not len(places):
            continue
        inside = ((places >= 0) & (places < camera.size)).all(axis=1)
        centre = (places.min(axis=0) + places.max(axis=0)) / 2
        if ((centre < 0) | (centre >= camera.size)).any():
            continue
        count = 0 if own is None else len(own.points) + len(own.skis)
        length = sum(float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum()) for line in overlay.lines.values())
        views.append(_View(name, image, overlay, _px_per_m(camera, middle), (bool(inside.all()), count, length)))
    return max(views, key=lambda view: view.rank, default=None)


def _px_per_m(camera: PlacedCamera, xyz: Floats) -> float:
    """Scale of an image at a place (3,): root of the area that a square metre across the ray covers."""
    _, by_point, _ = camera.linearised(xyz[None], camera.project(xyz)[None])
    larger, smaller = np.linalg.svd(by_point[0], compute_uv=False)
    return float(np.sqrt(larger * smaller))


def _width_m(views: Sequence[_View]) -> float:
    """So wide are all pictures at the jumper that the largest has room."""
    spans = [np.ptp(view.overlay.places(), axis=0) / view.scale for view in views]
    return max((max(across, down * WIDTH / HEIGHT) for across, down in spans), default=1.0) * _MARGIN_FACTOR


def _shot(place: float, moment: Moment | None, view: _View | None, width_m: float) -> Shot:
    if moment is None:
        return Shot(place, Missing.NOT_MEASURED)
    if view is None:
        return Shot(place, Missing.NO_PICTURE, moment)
    larger = WIDTH / (width_m * view.scale)
    places = view.overlay.places()
    middle = (places.min(axis=0) + places.max(axis=0)) / 2
    origin = middle - np.array((WIDTH - 1, HEIGHT - 1)) / 2 / larger
    onto = np.hstack((np.eye(2) / larger, origin[:, None]))  # from px of the picture to px of the image
    picture = cv2.warpAffine(
        view.image,
        onto,
        (WIDTH, HEIGHT),
        flags=cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=(_BESIDE,),
    )
    overlay = view.overlay.mapped(origin, larger)
    return Shot(place, None, moment, view.camera, np.asarray(picture, np.uint8), overlay, WIDTH / width_m)
