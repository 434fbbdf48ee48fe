"""What the page shows of each pulse: three views with overlay, stick figure, numbers."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from analysis.measurements.model import ImageMeasurements, JumpMeasurements
from analysis.report.charts import cursor_places
from analysis.report.course import Course, best_state
from analysis.report.crops import CROP_HEIGHT, CROP_WIDTH, Crop
from analysis.report.figures import fixed, plus_minus
from analysis.report.language import Said, attribute
from analysis.report.overlay import Overlay, half_axes, overlay_of, stick_lines
from analysis.result.model import PulseState, Quantity
from analysis.scene.camera_system import CameraSystem
from rig.arrays import Floats

#: Numbers beside the views: quantity, words, unit.
READOUT = (
    ("speed", Said("Speed v", "Fart v"), "m/s"),
    ("height", Said("Height Z0", "Høyde Z0"), "m"),
    ("alpha", Said("Skis to legs, alpha", "Ski mot legger, alfa"), "°"),
    ("beta", Said("Hip, beta", "Hofte, beta"), "°"),
    ("gamma", Said("V angle, gamma", "V-vinkel, gamma"), "°"),
    ("dphi", Said("Delta-phi", "Delta-phi"), "°"),
    ("phi", Said("Slope of skis, phi", "Skienes helning, phi"), "°"),
    ("angle_of_attack", Said("Angle of attack", "Angrepsvinkel"), "°"),
)
_CROSS = 4.0  # half the size of a measured point's mark, page units


def shown_pulses(course: Course, most: int) -> list[int]:
    """Indices of the pulses that can be scrubbed: all, or evenly distributed ones if they are too many."""
    n = len(course.pulses)
    return np.unique(np.linspace(0, n - 1, min(n, most)).round().astype(int)).tolist() if n else []


def overlays_of(
    course: Course, shown: Sequence[int], measured: JumpMeasurements | None, system: CameraSystem
) -> dict[int, dict[str, Overlay]]:
    """By pulse and camera what is drawn over the images of these pulses."""
    by_pulse: dict[int, Mapping[str, ImageMeasurements]] = {}
    if measured is not None:
        by_pulse = {int(pulse.pulse): pulse.images for pulse in measured.pulses}
    found = {}
    for i in shown:
        pulse = course.pulses[i]
        images = by_pulse.get(int(pulse.pulse), {})
        found[int(pulse.pulse)] = {
            name: overlay_of(best_state(pulse), images.get(name), camera, pulse.fates)
            for name, camera in system.cameras.items()
        }
    return found


def frames_json(
    course: Course,
    shown: Sequence[int],
    cameras: Sequence[str],
    overlays: Mapping[int, Mapping[str, Overlay]],
    crops: Mapping[tuple[int, str], Crop],
) -> list[dict[str, Any]]:
    """One object per pulse for the page's script."""
    cursors = cursor_places(course)
    frames = []
    for i in shown:
        pulse = course.pulses[i]
        number = int(pulse.pulse)
        views = [
            None
            if (crop := crops.get((number, name))) is None
            else {"src": crop.data, "over": overlay_svg(crop.window.on_page(overlays[number][name]))}
            for name in cameras
        ]
        frames.append(
            {
                "words": _words(course, i),
                "cursor": cursors[i],
                "unsure": bool(course.unsure[i]),
                "views": views,
                "stick": {part: _rounded(line) for part, line in _own_frame(course, pulse).items()},
                "numbers": [plus_minus(quantity_at(course, name, i), unit) for name, _, unit in READOUT],
            }
        )
    return frames


def overlay_svg(overlay: Overlay) -> str:
    """An overlay in page units as shapes of an SVG of the crops' size."""
    parts = []
    for part, line in overlay.lines.items():
        places = " ".join(f"{x:.1f},{y:.1f}" for x, y in line)
        parts += [f'<polyline class="halo" points="{places}"/>', f'<polyline class="{part}" points="{places}"/>']
    for name, ((x, y), covariance) in overlay.ellipses.items():
        long, short, turn = half_axes(covariance)
        kind = ' class="predicted"' if name in overlay.predicted else ""
        move = f"translate({x:.1f} {y:.1f}) rotate({turn:.0f})"
        parts.append(f'<ellipse{kind} rx="{long:.1f}" ry="{short:.1f}" transform="{move}"/>')
    for side, points in overlay.skis.items():
        parts += [f'<circle class="{side}" cx="{x:.1f}" cy="{y:.1f}" r="1.2"/>' for x, y in points]
    crosses = "".join(f"M{x:.1f} {y:.1f}L{to_x:.1f} {to_y:.1f}" for (x, y), (to_x, to_y) in overlay.crosses(_CROSS))
    if crosses:
        parts.append(f'<path class="halo" d="{crosses}"/><path class="point" d="{crosses}"/>')
    return "".join(parts)


def still_svg(overlay: Overlay, crop: Crop, words: Said) -> str:
    """A crop with its overlay as one picture for print."""
    return (
        f'<svg class="view" viewBox="0 0 {CROP_WIDTH} {CROP_HEIGHT}" role="img" {attribute("aria-label", words)}>'
        f'<image href="{crop.data}" width="{CROP_WIDTH}" height="{CROP_HEIGHT}"/>'
        f"<g>{overlay_svg(crop.window.on_page(overlay))}</g></svg>"
    )


def _words(course: Course, i: int) -> str:
    """When and where a pulse is."""
    where = f" · {fixed(float(course.distance[i]), 1)} m" if np.isfinite(course.distance[i]) else ""
    return f"{fixed(float(course.since[i]), 3)} s{where} · pulse {course.pulses[i].pulse}".replace(
        " s", "\N{NO-BREAK SPACE}s"
    )


def _own_frame(course: Course, pulse: PulseState) -> dict[str, Floats]:
    """The stick model along the flight, to the left and up, m, from the middle of body and skis."""
    lines = {part: line @ course.axes.T for part, line in stick_lines(best_state(pulse)).items()}
    if not lines:
        return {}
    places = np.concatenate(list(lines.values()))
    middle = lines["feet"].mean(axis=0) if "feet" in lines else (places.min(axis=0) + places.max(axis=0)) / 2
    return {part: line - middle for part, line in lines.items()}


def quantity_at(course: Course, name: str, i: int) -> Quantity | None:
    """A quantity at pulse `i` of a course: smoothed, else of the pulse alone; None where there is none."""
    for series in (course.smoothed[name], course.raw[name]):
        if np.isfinite(series.value[i]):
            return Quantity(float(series.value[i]), float(series.sigma[i]))
    return None


def _rounded(line: Floats) -> list[list[float]]:
    return [[round(float(value), 3) for value in place] for place in line]
