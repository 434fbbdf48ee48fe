"""The record of a calibration from pictures: verdict, pictures, coverage, projected grid; then the adjustment's own."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np

from analysis.targets.calibrating import PictureCalibration
from analysis.targets.network_of import Picture
from analysis.targets.verdict import CameraVerdict, lens_sigmas
from photogrammetry.adjustment.solution.adjustment import Adjustment
from photogrammetry.geometry.camera_model import Lens, undistort
from photogrammetry.reports.document import Drawing, Report, Section, Table
from photogrammetry.reports.drawing.svg import Colour
from photogrammetry.reports.drawing.to_scale import Canvas, nice
from photogrammetry.reports.procedures import calibration_lines, calibration_report, calibration_to_json
from rig.arrays import Floats

_LINES: Final = (17, 13)  # of the grid
_ALONG: Final = 60  # places along a line
_SHOWN: Final = 0.04  # of the picture's width, that the largest shift is drawn with at most


def to_json(made: PictureCalibration) -> dict[str, Any]:
    """The result file (`svev-adjustment/1`), with the verdict on each camera under `verdicts`."""
    result = calibration_to_json(made.calibration)
    return result | {
        "notes": [*made.notes, *result["notes"]],
        "verdicts": {
            verdict.camera: {
                "good": verdict.good,
                "pictures": verdict.pictures,
                "lens_px": verdict.lens_px,
                "words": verdict.words,
                "advice": [advice.text for advice in verdict.advice],
            }
            for verdict in made.verdicts
        },
    }


def lines(made: PictureCalibration) -> list[str]:
    """Lines for the screen; the verdict is the last that one reads."""
    return [
        *calibration_lines(made.calibration),
        *(f"note: {note}" for note in made.notes),
        *verdict_lines(made.verdicts),
    ]


def verdict_lines(verdicts: Sequence[CameraVerdict]) -> list[str]:
    """Each verdict, and what would make the calibration better."""
    told = []
    for verdict in verdicts:
        told.append(verdict.words)
        told += [f"  {'still better' if verdict.good else 'to do'}: {advice}" for advice in verdict.advice]
    return told


def report(made: PictureCalibration) -> Report:
    """The whole record."""
    whole = calibration_report(made.calibration)
    a = made.calibration.outcome.adjustment
    parts: list[Drawing] = []
    for i, camera in enumerate(a.network.cameras):
        pictures = [picture for picture in made.pictures if picture.camera == camera.name]
        parts += [_coverage(camera.name, pictures), _grid(a, i, pictures[0].sight.size)]
    sections = (
        Section("Verdict", (*verdict_lines(made.verdicts), *made.notes)),
        Section("Pictures", (_table(made.pictures),)),
        Section("Coverage and lens", tuple(parts)),
    )
    return replace(whole, sections=(*sections, *whole.sections))


def _table(pictures: Sequence[Picture]) -> Table:
    head = ("picture", "camera", "targets", "corners", "sigma px", "blur px")
    return Table(head, tuple(_row(picture) for picture in pictures))


def _row(picture: Picture) -> tuple[str, ...]:
    sight = picture.sight
    sigma = np.median([(corner.sigma_x, corner.sigma_y) for corner in sight.corners.values()])
    counts = str(len(sight.targets)), str(len(sight.corners))
    return (picture.name, picture.camera, *counts, f"{sigma:.3f}", f"{sight.blur:.2f}")


def _outline(size: tuple[int, int]) -> Floats:
    return np.array([(-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)]) * (np.array(size) / 2.0)


def _coverage(name: str, pictures: Sequence[Picture]) -> Drawing:
    """Where all pictures of a camera show corners."""
    size = pictures[0].sight.size
    outline = _outline(size)
    canvas = Canvas(outline, margin=8.0)
    canvas.svg.path([canvas.at(corner) for corner in outline], Colour.FAINT, width=1.0)
    middle = (np.array(size) - 1.0) / 2.0
    for picture in pictures:
        for corner in picture.sight.corners.values():
            canvas.svg.dot(*canvas.at((np.array((corner.x, corner.y)) - middle) * (1.0, -1.0)), Colour.BLUE, 1.2)
    caption = f"Camera {name}: all corners of {len(pictures)} pictures. Where there are none, the lens is not known."
    return Drawing(caption, canvas.svg.rendered(caption))


def _grid(a: Adjustment, camera: int, size: tuple[int, int]) -> Drawing:
    """A square grid in space as the camera shows it, and what is known of it."""
    network = a.network
    lens = Lens(a.state.interior[camera], np.asarray(network.cameras[camera].balance), np.asarray(False))
    outline = _outline(size)
    canvas = Canvas(outline, margin=16.0)
    canvas.svg.path([canvas.at(corner) for corner in outline], Colour.FAINT, width=1.0)
    x, y = (np.linspace(-part / 2.0, part / 2.0, count) for part, count in zip(size, _LINES, strict=True))
    along = [np.linspace(-part / 2.0, part / 2.0, _ALONG) for part in size]
    straight = [np.column_stack((np.full(_ALONG, each), along[1])) for each in x]
    straight += [np.column_stack((along[0], np.full(_ALONG, each))) for each in y]
    # a place that is `ideal` without distortion is seen at `place`: undistort(place) = ideal
    shifts = [line - (undistort(lens, line + lens.interior[1:3])) for line in straight]
    largest = max(float(np.nanmax(np.linalg.norm(shift, axis=1))) for shift in shifts)
    magnified = max(1.0, nice(_SHOWN * size[0] / largest)) if largest > 0.0 else 1.0
    for line, shift in zip(straight, shifts, strict=True):
        seen = (line + magnified * shift)[np.isfinite(shift).all(axis=1)]
        canvas.svg.path([canvas.at(place) for place in line[[0, -1]]], Colour.FAINT, width=0.6)
        canvas.svg.path([canvas.at(place) for place in seen], Colour.BLUE, width=1.0)
    _, sigmas = lens_sigmas(a, camera, size)
    caption = (
        f"Camera {network.cameras[camera].name}: a square grid as the lens shows it, its shifts {magnified:g} times "
        f"enlarged (the largest is {largest:.2g} px). The lens is known to {np.sqrt(np.mean(sigmas**2)):.2g} px (rms), "
        f"to {sigmas.max():.2g} px in the worst place."
    )
    return Drawing(caption, canvas.svg.rendered(caption))
