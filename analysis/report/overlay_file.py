"""`overlay.json` (`svev-overlay/1`): what a page draws over the images of a log, and beside them, without computing.

By pulse and camera the projected stick model in px of the camera's own image, (0, 0) in the centre of its first pixel;
where a frame shook, the shake is put back, so that the model lies on the jumper in that frame. Beside it the curves of
the report.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from analysis.cameras.standing import Standing, steadied
from analysis.report.charts import GRAPHS
from analysis.report.course import Course, best_state, course_of
from analysis.report.overlay import overlay_of
from analysis.report.scrubbing import quantity_at
from analysis.result.model import Jump, JumperState, MeasuredRecording
from rig.arrays import Floats
from rig.host.disk import replace_file
from rig.pulse import PulseNumber

FORMAT: Final = "svev-overlay/1"
#: Name of the file in a folder of results.
NAME: Final = "overlay.json"
_PX_DIGITS: Final = 1
_DIGITS: Final = 5


def write_overlay(result: MeasuredRecording, standings: Mapping[int, Standing], path: Path) -> None:
    """Write the file.

    Args:
        result: what was measured.
        standings: by number of the jump, how the cameras stood during it.
        path: the file.

    Raises:
        OSError: the disk refuses.
    """
    content = {
        "format": FORMAT,
        "jumps": [_jump(jump, result.rate_hz, standings[jump.number]) for jump in result.jumps],
    }
    replace_file(path, (json.dumps(content, allow_nan=False, separators=(",", ":")) + "\n").encode(), links=False)


def projected(state: JumperState, pulse: PulseNumber, standing: Standing) -> dict[str, dict[str, Any]]:
    """By camera the stick model in the frame of a pulse, px; cameras that do not show any of it are left out.

    `lines`: (m, 2) by part (body: P1, P2, O; feet; right and left: the skis, tail to tip), with places between the
    ends, since a lens may bend them. `points`: (2,) by name.
    """
    found: dict[str, dict[str, Any]] = {}
    for name, camera in standing.system.cameras.items():
        over = overlay_of(state, None, camera)
        points = {point: xy for point, (xy, _) in over.ellipses.items()}
        places = [*over.lines.values(), *(xy[None] for xy in points.values())]
        if not places:
            continue
        ends = np.cumsum([len(part) for part in places])[:-1]
        xy = np.concatenate(places)
        shake = standing.shake.get(name, {}).get(pulse)
        if shake is not None:
            xy = steadied(camera, shake.reversed(), xy)[0]
        if not ((xy >= -0.5) & (xy < camera.size - 0.5)).all(axis=1).any():
            continue
        parts = np.split(xy, ends)
        lines = dict(zip(over.lines, parts, strict=False))
        found[name] = {"lines": lines, "points": dict(zip(points, (p[0] for p in parts[len(lines) :]), strict=True))}
    return found


def _jump(jump: Jump, rate_hz: float, standing: Standing) -> dict[str, Any]:
    course = course_of(jump, rate_hz)
    takeoff = jump.takeoff
    return {
        "number": jump.number,
        "takeoff": None if takeoff is None else {"pulse": takeoff.pulse, "sigma_pulses": takeoff.sigma_pulses},
        "pulses": [_pulse(course, i, standing) for i in range(len(course.pulses))],
        "curves": [_curve(course, graph.name, graph.unit, graph.least) for graph in GRAPHS],
    }


def _pulse(course: Course, i: int, standing: Standing) -> dict[str, Any]:
    pulse = course.pulses[i]
    state = best_state(pulse)
    images = {
        name: {
            "lines": {part: _places(line) for part, line in seen["lines"].items()},
            "points": {point: _places(xy) for point, xy in seen["points"].items()},
        }
        for name, seen in projected(state, pulse.pulse, standing).items()
    }
    return {
        "pulse": int(pulse.pulse),
        "since_s": round(float(course.since[i]), _DIGITS),
        "distance_m": _number(float(course.distance[i])),
        "smoothed": pulse.smoothed is not None,
        "unsure": bool(course.unsure[i]),
        "status": {name: point.status.value for name, point in state.points.items() if point is not None},
        "images": images,
    }


def _curve(course: Course, name: str, unit: str, least: float) -> dict[str, Any]:
    """A quantity at all pulses, as the report says it; null where there is none."""
    quantities = [quantity_at(course, name, i) for i in range(len(course.pulses))]
    return {
        "name": name,
        "unit": unit,
        "least": least,
        "value": [None if q is None else _number(q.value) for q in quantities],
        "sigma": [None if q is None else _number(q.sigma) for q in quantities],
    }


def _places(xy: Floats) -> Any:
    return np.round(xy, _PX_DIGITS).tolist()


def _number(value: float) -> float | None:
    return round(value, _DIGITS) if np.isfinite(value) else None
