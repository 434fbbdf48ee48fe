"""Two jumps at the same places: pictures of both, and their stick figures over each other."""

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import Final

import cv2
import numpy as np

from analysis.cameras.frames import camera_images
from analysis.measurements.file import read_measurements
from analysis.measurements.model import ImageMeasurements, Measurements
from analysis.report.compared.words import text
from analysis.report.course import Course, best_state, origin_of
from analysis.report.frames import Grey, frames_of
from analysis.report.overlay import stick_lines
from analysis.result.model import PulseState
from rig.arrays import Floats

#: Distances from the take-off, m.
PLACES_M: Final = (0, 5, 10, 15, 20)
#: Of the pictures, px; the drawings have half of it in page units.
_WIDTH, _HEIGHT = 240, 180
_MARGIN_FACTOR: Final = 1.3  # around the largest jumper: helmet and hands reach beyond the points
_LEAST_PX: Final = 48.0
_QUALITY: Final = 65
_SPAN_M: Final = 3.8  # that a drawing shows from left to right
_DOT_M: Final = 0.14  # radius of the helmet
_UNEVEN: Final = 0.6  # a pulse may be off a place by so much of the way between two


@dataclass(frozen=True, slots=True, eq=False)
class Images:
    """Where the images of a jump are, and what was measured in them."""

    log: Path
    measurements: Measurements


@dataclass(frozen=True, slots=True)
class _Cut:
    """A part of an image: whose, its middle and half its extent, px."""

    jump: int
    place: int
    pulse: int
    camera: str
    middle: tuple[float, float]
    extent: float


def images_beside(log: Path, folder: Path) -> Images | None:
    """The images of a log whose result is in a folder; None if the folder does not say what was measured in them.

    Raises:
        BadInputError: what it says cannot be read.
    """
    measurements = folder / "measurements.json"
    return Images(log, read_measurements(measurements)) if measurements.is_file() else None


def at_places(courses: Sequence[Course], numbers: Sequence[int], images: Sequence[Images | None]) -> str:
    """The section's rows, one for each place that both jumps reach.

    Args:
        courses: of A and B.
        numbers: of the jumps in their recordings.
        images: of both; None where they are not there.

    Raises:
        BadInputError: a log cannot be read.
    """
    pulses = [[_pulse_at(course, place) for place in PLACES_M] for course in courses]
    reached = [index for index in range(len(PLACES_M)) if all(own[index] is not None for own in pulses)]
    pictures = _pictures(reached, pulses, numbers, images)
    head = f"<tr><td></td>{'<th>A</th><th>B</th>' if pictures else ''}<th>{text('over')}</th></tr>"
    rows = [head]
    for index in reached:
        name = text("place", metres=PLACES_M[index]) if PLACES_M[index] else text("edge")
        cells = [f"<td>{pictures.get((jump, index), '')}</td>" for jump in (0, 1)] if pictures else []
        one, other = pulses[0][index], pulses[1][index]
        if one is not None and other is not None:
            cells.append(f"<td>{_sticks(courses, (one, other), PLACES_M[index])}</td>")
        rows.append(f"<tr><th>{name}</th>{''.join(cells)}</tr>")
    missing = "" if pictures else text("no_pictures", "p")
    return f'<table class="places{"" if pictures else " drawn"}">{"".join(rows)}</table>{missing}'


def _pulse_at(course: Course, place: float) -> PulseState | None:
    """The measured pulse that is nearest to a place; None if none is near."""
    known = np.flatnonzero(np.isfinite(course.distance))
    if course.takeoff_sigma_s is None or len(known) < 2:
        return None
    off = np.abs(course.distance[known] - place)
    step = float(np.median(np.abs(np.diff(course.distance[known]))))
    return course.pulses[known[off.argmin()]] if off.min() <= _UNEVEN * step else None


def _sticks(courses: Sequence[Course], pulses: tuple[PulseState, PulseState], place: int) -> str:
    """Both stick figures from the side, with the middle between the bindings over each other along the flight."""
    drawn = [_from_the_side(course, pulse) for course, pulse in zip(courses, pulses, strict=True)]
    heights = [height for _, height in drawn]
    scale, middle = _WIDTH / 2 / _SPAN_M, float(np.mean(heights))
    parts = []
    for colour, (lines, _) in zip(("amber", "blue"), drawn, strict=True):
        for name, line in lines.items():
            page = (line - (0.0, middle)) * (scale, -scale) + (_WIDTH / 4, _HEIGHT / 2 * 0.62)
            points = " ".join(f"{x:.1f},{y:.1f}" for x, y in page)
            parts.append(f'<polyline class="{colour}" points="{points}"/>')
            if name == "body":
                parts.append(
                    f'<circle class="{colour}" cx="{page[0, 0]:.1f}" cy="{page[0, 1]:.1f}" r="{_DOT_M * scale:.1f}"/>'
                )
    head = f'viewBox="0 0 {_WIDTH // 2} {_HEIGHT // 2}" role="img" aria-label="A, B: {place} m"'
    return f'<svg xmlns="http://www.w3.org/2000/svg" {head}>{"".join(parts)}</svg>'


def _from_the_side(course: Course, pulse: PulseState) -> tuple[dict[str, Floats], float]:
    """Lines (m, 2) along the flight from O and above the take-off, m, and how high O is."""
    state = best_state(pulse)
    origin = origin_of(state)
    lines = {name: (line - course.start) @ course.axes[[0, 2]].T for name, line in stick_lines(state).items()}
    along, height = (np.zeros(3) if origin is None else origin - course.start) @ course.axes[[0, 2]].T
    return {name: line - (along, 0.0) for name, line in lines.items() if name != "feet"}, float(height)


def _pictures(
    reached: Sequence[int],
    pulses: Sequence[Sequence[PulseState | None]],
    numbers: Sequence[int],
    images: Sequence[Images | None],
) -> dict[tuple[int, int], str]:
    """Pictures by jump and place, cut from the camera that sees most of both; all of a camera have one scale."""
    measured = [_by_pulse(own, number) for own, number in zip(images, numbers, strict=True)]
    cuts: list[_Cut] = []
    for index in reached:
        found = [
            measured[jump].get(int(each.pulse), {}) for jump in (0, 1) if (each := pulses[jump][index]) is not None
        ]
        for jump, own in enumerate(found):
            camera = _camera(own, found[1 - jump])
            state = pulses[jump][index]
            if camera is not None and state is not None:
                cuts.append(_cut(jump, index, int(state.pulse), camera, own[camera]))
    widths = {
        camera: max(cut.extent for cut in cuts if cut.camera == camera) for camera in {cut.camera for cut in cuts}
    }
    pictures: dict[tuple[int, int], str] = {}
    for jump, own_images in enumerate(images):
        own_cuts = {cut.pulse: cut for cut in cuts if cut.jump == jump}
        if own_images is None or not own_cuts:
            continue
        for tag, image in frames_of(own_images.log, own_cuts.keys()):
            cut = own_cuts[int(tag.pulse)]
            if (frame := camera_images(tag, image).get(cut.camera)) is not None:
                words = f"{'AB'[jump]}, {PLACES_M[cut.place]} m, {cut.camera}"
                pictures[jump, cut.place] = (
                    f'<img alt="{escape(words)}" src="{_address(frame, cut, widths[cut.camera])}">'
                )
    return pictures


def _by_pulse(images: Images | None, number: int) -> dict[int, Mapping[str, ImageMeasurements]]:
    if images is None:
        return {}
    return {
        int(pulse.pulse): pulse.images
        for jump in images.measurements.jumps
        if jump.number == number
        for pulse in jump.pulses
    }


def _camera(own: Mapping[str, ImageMeasurements], other: Mapping[str, ImageMeasurements]) -> str | None:
    """The camera in which most was measured of the one of two jumps of which less was, then of this one."""
    counts = {name: (_count(other.get(name)) if other else 1, _count(image)) for name, image in own.items()}
    seen = [name for name, (_, count) in counts.items() if count > 1]
    return max(seen, key=lambda name: (min(counts[name]), counts[name][1]), default=None)


def _count(image: ImageMeasurements | None) -> int:
    return 0 if image is None else len(image.points) + len(image.skis)


def _cut(jump: int, place: int, pulse: int, camera: str, image: ImageMeasurements) -> _Cut:
    found = np.concatenate(
        [*(each.xy[None] for each in image.points.values()), *(ski.xy for ski in image.skis.values())]
    )
    low, high = found.min(axis=0), found.max(axis=0)
    across, down = high - low
    middle = (low + high) / 2
    extent = max(across, down * _WIDTH / _HEIGHT) * _MARGIN_FACTOR
    return _Cut(jump, place, pulse, camera, (float(middle[0]), float(middle[1])), max(float(extent), _LEAST_PX))


def _address(image: Grey, cut: _Cut, width: float) -> str:
    """The `data:` address of a part of an image."""
    larger = _WIDTH / width
    corner = np.array(cut.middle) - np.array((_WIDTH - 1, _HEIGHT - 1)) / 2 / larger
    onto = np.hstack((np.eye(2) / larger, corner[:, None]))
    flags = cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP
    part = cv2.warpAffine(
        image, onto, (_WIDTH, _HEIGHT), flags=flags, borderMode=cv2.BORDER_CONSTANT, borderValue=(24,)
    )
    encoded = cv2.imencode(".webp", part, [cv2.IMWRITE_WEBP_QUALITY, _QUALITY])[1].tobytes()
    return "data:image/webp;base64," + base64.b64encode(encoded).decode("ascii")
