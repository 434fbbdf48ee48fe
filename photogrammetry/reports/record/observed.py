"""Sections with every observation: its residual, redundancy number, test value, and what an error of it would do.

Observations that were taken out stand where they would stand, with their residuals against the result that does without
them.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from photogrammetry.adjustment.equations.relations import Kind
from photogrammetry.adjustment.gross_errors.blunders import (
    BlunderKind,
    Observation,
    Removed,
    in_file_frame,
    name_of,
    observation_to_json,
)
from photogrammetry.adjustment.run import Outcome
from photogrammetry.adjustment.solution.adjustment import Adjustment
from photogrammetry.adjustment.solution.reliability import Effects, Reliability
from photogrammetry.geometry.camera_model import INTERIOR, image_point
from photogrammetry.network.file_writer import metric_to_pixel
from photogrammetry.network.model import AXES, ImageFrame, Role
from photogrammetry.network.selection import with_interior
from photogrammetry.reports.document import Table
from photogrammetry.reports.record.digits import residual, sized, tested
from photogrammetry.reports.result_file import POSE
from rig.arrays import Floats, Integers

TAKEN_OUT, LEFT_ASIDE = "taken out", "left aside"


@dataclass(frozen=True, slots=True, eq=False)
class Gone:
    """An image observation that the result does without.

    Attributes:
        image, point: names.
        xy: (2,) metric frame.
        sigma: (2,) a priori.
        words: why.
    """

    image: str
    point: str
    xy: Floats
    sigma: Floats
    words: str


def gone_images(outcome: Outcome) -> list[Gone]:
    """All image observations that the result does without, each once."""
    found: dict[tuple[str, str], Gone] = {}
    for removed, one, words in _gone(outcome):
        if one.kind is BlunderKind.IMAGE:
            names, o = observation_to_json(removed.network, one), removed.network.observations
            key = names["image"], names["point"]
            found.setdefault(key, Gone(*key, o.xy[one.index], o.sigma[one.index], words))
    return list(found.values())


def gone_survey(outcome: Outcome) -> dict[str, str]:
    """Names of the surveyed points that the result does without, and why."""
    return {
        removed.network.points[one.index].name: words
        for removed, one, words in reversed(list(_gone(outcome)))
        if one.kind is BlunderKind.CONTROL
    }


def _gone(outcome: Outcome) -> Iterator[tuple[Removed, Observation, str]]:
    for removed in outcome.removed:
        yield removed, removed.blunder.suspect, TAKEN_OUT
    for aside in outcome.aside:
        for one in aside.blunder.candidates or (aside.blunder.suspect,):
            yield aside, one, LEFT_ASIDE


def image_parts(outcome: Outcome, effects: Effects | None) -> Iterator[str | Table]:
    """One table for each image; with `effects` the minimal detectable blunders and what they do."""
    a = outcome.adjustment
    gone = gone_images(outcome)
    head: tuple[str, ...] = ("point", "x", "y", "vx", "vy", "rx", "ry", "wx", "wy")
    if effects is not None:
        head = (*head, "finds x", "finds y", "moves", "by")
    points = {point.name: i for i, point in enumerate(a.network.points)}
    numbered = _numbers_of(a, effects)
    for i, image in enumerate(a.network.images):
        begin, stop = int(a.problem.start[i]), int(a.problem.start[i + 1])
        rows = [(int(a.problem.point[row]), numbered[row]) for row in range(begin, stop)]
        for one in (one for one in gone if one.image == image.name):
            place = points.get(one.point, len(points))
            rows.append((place, _gone_row(a, i, place, one, len(head))))
        if rows:
            yield f"Image {image.name}:"
            yield Table(head, tuple(row for _, row in sorted(rows, key=lambda item: item[0])))


def _numbers_of(a: Adjustment, effects: Effects | None) -> list[tuple[str, ...]]:
    """The rows of all image observations, in the problem's order."""
    network, sigma = a.network, a.problem.sigma
    start = a.problem.start
    pieces = [_in_file(a, i, a.problem.xy[start[i] : start[i + 1]]) for i in range(len(network.images))]
    xy = np.concatenate(pieces) if pieces else a.problem.xy
    v, w = in_file_frame(network, a.image_residuals()), in_file_frame(network, a.image_w())
    r, names = a.controlled.image_numbers, [point.name for point in network.points]
    rows = [
        (
            names[point],
            *(residual(x, s) for x, s in zip(xy[i], sigma[i], strict=True)),
            *(residual(x, s) for x, s in zip(v[i], sigma[i], strict=True)),
            *(tested(x, 2) for x in r[i]),
            *(tested(x, 1) for x in w[i]),
        )
        for i, point in enumerate(a.problem.point)
    ]
    if effects is None:
        return rows
    found = a.image_detectable()
    return [
        (*row, *(sized(x) for x in found[i]), *_moved(a, effects.length[i], effects.place[i]))
        for i, row in enumerate(rows)
    ]


def _in_file(a: Adjustment, image: int, xy: Floats) -> Floats:
    """Metric coordinates (n, 2) of one image in the file's frame."""
    size = a.network.cameras[a.network.images[image].camera].size
    if a.network.image_frame is not ImageFrame.PIXEL or size is None:
        return xy
    return metric_to_pixel(xy, np.array(size))


def _gone_row(a: Adjustment, image: int, place: int, one: Gone, width: int) -> tuple[str, ...]:
    """The row of an observation that the result does without; its residual where the result has the point."""
    network = with_interior(a.network, a.state.interior)
    values = ["-", "-"]
    if place < len(network.points):
        lens = network.cameras[network.images[image].camera].lens()
        seen = image_point(lens, a.state.rotation[image], a.state.position[image], a.state.xyz[place])
        v = in_file_frame(network, np.asarray(seen - one.xy, dtype=float))
        values = [residual(x, s) for x, s in zip(v, one.sigma, strict=True)]
    xy = _in_file(a, image, one.xy[None])[0]
    row = (one.point, *(residual(x, s) for x, s in zip(xy, one.sigma, strict=True)), *values, one.words)
    return (*row, *[""] * (width - len(row)))


def _moved(a: Adjustment, length: Floats, place: Integers) -> tuple[str, str]:
    """The largest displacement by an undetected error of any coordinate of an observation, and of what."""
    if not len(length) or not np.isfinite(length).any():
        return "-", "-"
    worst = int(np.argmax(np.where(np.isfinite(length), length, -1.0)))
    return sized(float(length[worst])), place_name(a, int(place[worst]))


def place_name(a: Adjustment, place: int) -> str:
    """The name of a point, or of the image of a projection centre (see `Effects.place`)."""
    count = len(a.network.points)
    return a.network.points[place].name if place < count else a.network.images[place - count].name


def survey_parts(outcome: Outcome, effects: Effects | None) -> tuple[str | Table, ...]:
    """Every surveyed coordinate against the adjusted one; points that the result does without stand among them."""
    a = outcome.adjustment
    gone, relations = gone_survey(outcome), a.problem.relations
    of_point = {int(relations.item[rows[0]]): rows for rows in relations.rows(Kind.CONTROL).reshape(-1, 3)}
    head = ("point", "use", *(f"{x}{axis}" for x in "vrw" for axis in AXES))
    if effects is not None:
        head = (*head, *(f"finds {axis}" for axis in AXES), "moves", "by")
    rows = []
    for i, point in enumerate(a.network.points):
        if point.xyz is None or point.role not in (Role.CONTROL, Role.CHECK):
            continue
        use = gone.get(point.name, point.role.value)
        tests = of_point.get(i)
        if tests is None:
            sigma = a.sigmas(a.problem.unknowns.point[i])
            v = (residual(x, s) for x, s in zip(a.state.xyz[i] - point.xyz, sigma, strict=True))
            rows.append((point.name, use, *v, *["-"] * (len(head) - 5)))
        else:
            rows.append((point.name, use, *_relation_cells(a, tests), *_found(a, tests, effects)))
    if not rows:
        return ()
    return (f"Survey, adjusted - given, {a.length_unit or 'length units'}:", Table(head, tuple(rows)))


def _relation_cells(a: Adjustment, rows: Integers) -> tuple[str, ...]:
    v, r, w, sigma = a.relation_residuals(), a.controlled.relation, a.relation_w(), a.problem.relation_sigma
    return (
        *(residual(v[row], sigma[row]) for row in rows),
        *(tested(r[row], 2) for row in rows),
        *(tested(w[row], 1) for row in rows),
    )


def _found(a: Adjustment, rows: Integers, effects: Effects | None) -> tuple[str, ...]:
    if effects is None:
        return ()
    return (*(sized(x) for x in a.relation_detectable()[rows]), *_moved(a, effects.length[rows], effects.place[rows]))


def measured_parts(a: Adjustment, effects: Effects | None) -> tuple[str | Table, ...]:
    """Distances, differences, weighted camera parameters and poses."""
    relations, rows = a.problem.relations, []
    head: tuple[str, ...] = ("observation", "v", "r", "w")
    if effects is not None:
        head = (*head, "finds", "moves", "by")
    for kind in (Kind.DISTANCE, Kind.DIFFERENCE, Kind.CAMERA, Kind.POSE):
        for row in relations.rows(kind):
            one = np.array([row], dtype=np.intp)
            name = _named(a, kind, int(relations.item[row]), int(relations.part[row]))
            rows.append((name, *_relation_cells(a, one), *_found(a, one, effects)))
    return ("Distances, differences, weighted parameters:", Table(head, tuple(rows))) if rows else ()


def _named(a: Adjustment, kind: Kind, item: int, part: int) -> str:
    network = a.network
    match kind:
        case Kind.DISTANCE:
            return name_of(network, Observation(BlunderKind.DISTANCE, item)).text
        case Kind.DIFFERENCE:
            return name_of(network, Observation(BlunderKind.DIFFERENCE, item)).text
        case Kind.CAMERA:
            return f"camera {network.cameras[item].name} {INTERIOR[part]}"
        case _:
            return f"image {network.images[item].name} {POSE[part]}"


def reliability_parts(a: Adjustment, found: Reliability) -> tuple[str | Table, ...]:
    """The reliability of each kind of observation in one line."""
    unit, image_unit = a.length_unit or "length units", a.network.image_unit
    rows, start, smallest = [], a.problem.start, a.image_detectable()
    for i, image in enumerate(a.network.images):
        here = slice(start[i], start[i + 1])
        if start[i] < start[i + 1]:
            rows.append((f"image {image.name}, {image_unit}", *_summed(a, smallest[here], found.image, here)))
    relations, smallest = a.problem.relations, a.relation_detectable()
    for kind, name in (
        (Kind.CONTROL, "control points"),
        (Kind.DISTANCE, "distances"),
        (Kind.DIFFERENCE, "differences"),
    ):
        chosen = relations.rows(kind)
        if len(chosen):
            rows.append((f"{name}, {unit}", *_summed(a, smallest[chosen], found.relation, chosen)))
    head = ("of", "median finds", "largest finds", "not controlled", f"moves ({unit})", "by")
    return (
        "finds: the smallest error that its test finds in four of five cases at a risk of 0.1 % (internal reliability)",
        "moves: the largest shift of a point or projection centre by an error of that size (external reliability)",
        Table(head, tuple(rows)),
    )


def _summed(a: Adjustment, finds: Floats, effects: Effects, rows: slice | Integers) -> tuple[str, ...]:
    known = finds[np.isfinite(finds)]
    sizes = (sized(float(np.median(known))), sized(float(known.max()))) if len(known) else ("-", "-")
    return (*sizes, str(finds.size - known.size), *_moved(a, effects.length[rows].ravel(), effects.place[rows].ravel()))
