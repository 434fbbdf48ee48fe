"""A video of the jumps with the overlay drawn into every triplet: H.264 for phones, VP9, or FFV1 without loss.

Under the triplet, the jumper is enlarged.

Each frame stands at the time of its pulse, to a microsecond where the container allows it (MP4), to a millisecond in
WebM and Matroska. The pulse number is written into the picture.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from analysis.cameras.frames import camera_images
from analysis.film.video_file import ENDINGS, FFV1, VP9, VideoFile, h264
from analysis.film.whole import whole_file
from analysis.film.words import write_outlined
from analysis.measurements.model import Measurements
from analysis.report.course import Course, course_of
from analysis.report.crops import CROP_HEIGHT, CROP_WIDTH, Windows, windows_of
from analysis.report.figures import fixed
from analysis.report.frames import Grey, frames_of
from analysis.report.overlay import COLOURS, SHIFT, Overlay, fine, half_axes
from analysis.report.scrubbing import overlays_of
from analysis.result.model import MeasuredRecording
from analysis.scene.camera_system import CameraSystem
from rig.arrays import Floats
from rig.clocks import NS_PER_S
from rig.errors import BadInputError
from rig.tag import TripletTag

_Picture = NDArray[np.uint8]
_Colour = tuple[int, int, int]
Progress = Callable[[int, int], None]

#: Shown before and after each jump, s; between two jumps the video waits as long.
_AROUND_S: Final = 0.5
#: Wider triplets are made smaller, unless the video is without loss: phones show no more.
_WIDEST_PX: Final = 1920
#: Phones play H.264 in MP4.
_CODECS: Final = {".mp4": h264(23), ".webm": VP9, ".mkv": VP9}
_LETTERS: Final = 0.6  # size of words, in units of the font
#: Blue, green, red, as OpenCV and the encoder take them.
_COLOURS: Final[Mapping[str, _Colour]] = {part: (blue, green, red) for part, (red, green, blue) in COLOURS.items()}
_POINT: Final[_Colour] = (168, 92, 255)
_INK: Final[_Colour] = (255, 255, 255)


@dataclass(frozen=True, slots=True, eq=False)
class _Shown:
    """What is drawn at a pulse: words, and overlays by camera (none before and after the jump)."""

    words: str
    overlays: Mapping[str, Overlay]


def write_video(
    result: MeasuredRecording,
    measurements: Measurements,
    system: CameraSystem,
    log: Path,
    out: Path,
    *,
    lossless: bool = False,
    progress: Progress | None = None,
) -> int:
    """Write the video; holds one frame at a time.

    Args:
        result: what was measured.
        measurements: what was measured in the images of its jumps.
        system: the oriented cameras.
        log: where the images are.
        out: the file; its ending chooses the container: .mp4 or .webm for browsers, .mkv.
        lossless: FFV1; needs .mkv.
        progress: called with the number of frames done and to do.

    Returns:
        The number of frames.

    Raises:
        BadInputError: the log cannot be read or has no image of a jump, or `out` cannot be written.
    """
    if out.suffix not in ENDINGS:
        raise BadInputError(f"{out}: a video needs one of the endings {', '.join(ENDINGS)}; choose another name")
    if lossless and out.suffix != ".mkv":
        raise BadInputError(f"{out}: a video without loss needs the ending .mkv; choose another name")
    shown = _shown(result, measurements, system)
    windows = windows_of({pulse: one.overlays for pulse, one in shown.items()}, system)
    with whole_file(out) as part:
        done = 0
        video: VideoFile | None = None
        clock = _Clock()
        try:
            for tag, image in frames_of(log, shown.keys()):
                scale = 1.0 if lossless else min(1.0, _WIDEST_PX / image.shape[1])
                picture = _picture(tag, image, shown[int(tag.pulse)], windows, scale)
                if video is None:
                    video = VideoFile(
                        part, out.suffix, picture, result.rate_hz, FFV1 if lossless else _CODECS[out.suffix]
                    )
                video.add(picture, clock.at_us(tag))
                done += 1
                if progress is not None:
                    progress(done, len(shown))
            if video is not None:
                video.finish()
        finally:
            if video is not None:
                video.close()
        if not done:
            raise BadInputError(
                f"{log}: has no image of a jump, so that there is no video; look at it with `svev info`"
            )
    return done


class _Clock:
    """Times of pictures in the video: those of their pulses, but between two jumps no longer than it waits around."""

    def __init__(self) -> None:
        self._at_us = 0
        self._last: TripletTag | None = None

    def at_us(self, tag: TripletTag) -> int:
        """The time of the next picture, us."""
        if self._last is not None:
            step = round((tag.time - self._last.time) * 1e6 / NS_PER_S)
            self._at_us += min(max(step, 1), round(_AROUND_S * 1e6))
        self._last = tag
        return self._at_us


def _shown(result: MeasuredRecording, measurements: Measurements, system: CameraSystem) -> dict[int, _Shown]:
    """By pulse: those of the jumps and some before and after, in order."""
    measured = {jump.number: jump for jump in measurements.jumps}
    around = round(_AROUND_S * result.rate_hz)
    found: dict[int, _Shown] = {}
    for jump in result.jumps:
        if not jump.pulses:
            continue
        first, last = int(jump.pulses[0].pulse), int(jump.pulses[-1].pulse)
        for pulse in (*range(max(0, first - around), first), *range(last + 1, last + around + 1)):
            found.setdefault(pulse, _Shown(f"pulse {pulse}", {}))
        course = course_of(jump, result.rate_hz)
        everything = range(len(course.pulses))
        overlays = overlays_of(course, everything, measured.get(jump.number), system)
        found |= {int(course.pulses[i].pulse): _Shown(_words(course, i), {}) for i in everything}
        found |= {pulse: _Shown(found[pulse].words, images) for pulse, images in overlays.items()}
    return found


def _words(course: Course, i: int) -> str:
    """Pulse, time, speed; the font has no signs beyond ASCII."""
    words = f"pulse {course.pulses[i].pulse}  {fixed(float(course.since[i]), 3)} s"
    speed = float(course.smoothed["speed"].value[i])
    return (words + (f"  {speed:.1f} m/s" if np.isfinite(speed) else "")).replace("\N{MINUS SIGN}", "-")


def _picture(tag: TripletTag, image: Grey, shown: _Shown, windows: Windows, scale: float) -> _Picture:
    """The triplet in colour with its overlay, and under each camera's image the jumper enlarged."""
    there = camera_images(tag, image)
    size = round(image.shape[1] * scale), round(image.shape[0] * scale)
    blocks = {c.name: (round(c.columns[0] * scale), round(c.columns[1] * scale)) for c in tag.cameras}
    widest = max(right - left for left, right in blocks.values())
    rows = size[1]
    picture = np.zeros((rows + widest * CROP_HEIGHT // CROP_WIDTH, size[0], 3), np.uint8)
    small = image if scale == 1 else cv2.resize(image, size, interpolation=cv2.INTER_AREA)
    picture[:rows] = small[:, :, np.newaxis]
    for name, (left, right) in blocks.items():
        overlay, window = shown.overlays.get(name), windows.get((int(tag.pulse), name))
        if overlay is not None and window is not None and name in there:
            larger = (right - left) / window.width
            below = picture[rows : rows + round(window.height * larger), left:right]
            part = there[name][window.top :, window.left :][: window.height, : window.width]
            below[:] = cv2.resize(part, below.shape[1::-1], interpolation=cv2.INTER_CUBIC)[:, :, np.newaxis]
            _draw(below, _seen(overlay, window.corner, larger), 2)
            _draw(picture[:rows, left:right], _seen(overlay, np.full(2, -0.5), scale), 1)
        write_outlined(picture[:, left:right], name, (10, 24), _LETTERS)
    write_outlined(picture, shown.words, (10, rows - 12), _LETTERS)
    return picture


def _seen(overlay: Overlay, corner: Floats, scale: float) -> Overlay:
    """An overlay in px of a picture that begins at a corner of the image; (0, 0) is the centre of its first pixel."""
    return overlay.mapped(corner + 0.5 / scale, scale)


def _draw(block: _Picture, overlay: Overlay, width: int) -> None:
    """Draw an overlay into a picture, in place, with lines of so many px."""
    for part, line in overlay.lines.items():
        cv2.polylines(block, [fine(line)], False, _COLOURS[part], width, cv2.LINE_AA, SHIFT)
    for place, covariance in overlay.ellipses.values():
        long, short, turn = half_axes(covariance)
        if np.isfinite(place).all() and long < block.shape[1]:
            size = (fine(np.array(long)).item(), fine(np.array(short)).item())
            centre = tuple(fine(place).tolist())
            cv2.ellipse(block, centre, size, turn, 0, 360, _INK, 1, cv2.LINE_AA, SHIFT)
    for ends in overlay.crosses(3.0 * width):
        cv2.polylines(block, [fine(np.array(ends))], False, _POINT, width, cv2.LINE_AA, SHIFT)
    for side, points in overlay.skis.items():
        for x, y in fine(points):
            cv2.circle(block, (int(x), int(y)), width << SHIFT, _COLOURS[side], -1, cv2.LINE_AA, SHIFT)
