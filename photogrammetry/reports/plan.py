"""The report of a planned network: predicted sigmas as tables, as curves along the flight, in drawings, and as JSON."""

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from photogrammetry.adjustment.solution.adjustment import Adjustment
from photogrammetry.geometry.camera_model import INTERIOR
from photogrammetry.jumper.stick_model import ANGLES
from photogrammetry.planning.plan import Flight, Plan
from photogrammetry.planning.prediction import Sigmas, carry
from photogrammetry.reports.document import Drawing, Report, Section, Table
from photogrammetry.reports.drawing.network import Extras, Place, Track, network_drawings
from photogrammetry.reports.drawing.svg import Colour
from photogrammetry.reports.drawing.to_scale import Chart, rounded_up
from rig.arrays import Floats

_COLOURS = (Colour.BLUE, Colour.AMBER, Colour.INK)  # also colour-blind people can tell them apart
_BOTH = "curves by covariance, rings by Monte Carlo"
_EVERY = 4  # every fourth position is drawn; more would cover each other


def plan_report(plan: Plan, adjusted: Adjustment, predicted: Sigmas, simulated: Sigmas, samples: int) -> Report:
    """The report. Its tables have the sigma by covariance and, in brackets, by Monte Carlo."""
    flight = plan.flight
    extras = None if flight is None else flight_extras(plan, flight, adjusted)
    sections = [
        Section("Summary", _summary(plan, adjusted, predicted, simulated, samples)),
        Section("Network", network_drawings(adjusted, extras, a_priori=True)),
        Section("Cameras", _cameras(plan, predicted, simulated)),
    ]
    if flight is not None:
        sections.append(Section("Jumper points", _points(plan, flight, predicted, simulated)))
        if flight.ski_names:
            sections.append(Section("Skis", _skis(flight, predicted, simulated)))
        if flight.stick is not None:
            sections.append(Section("Body", _body(plan, predicted, simulated)))
    return Report(f"Plan: {plan.name}", tuple(sections))


def _summary(
    plan: Plan, adjusted: Adjustment, predicted: Sigmas, simulated: Sigmas, samples: int
) -> tuple[str | Table | Drawing, ...]:
    problem, unit = adjusted.problem, plan.network.length_unit
    size = f"{len(plan.network.images)} images, {len(plan.network.points)} points; image points to {plan.sigma:g} px"
    counts = f"{problem.n_observations} observations, {problem.unknowns.count} unknowns, redundancy"
    lines = [f"{counts} {adjusted.redundancy}; {size}"]
    if predicted.points.size:
        least, largest = (f(mean_of_position(predicted.points), axis=0) for f in (np.min, np.max))
        ranges = ", ".join(f"{axis} {a:.3g} to {b:.3g}" for axis, a, b in zip("XYZ", least, largest, strict=True))
        lines.append(f"jumper points, mean sigma of a position: {ranges} {unit}")
    worst, known = 100.0 * worst_disagreement(predicted, simulated), 100.0 / math.sqrt(2.0 * samples)
    lines.append(f"covariance and Monte Carlo differ by at most {worst:.1f} %")
    lines.append(f"{samples} samples: each simulated sigma is known to {known:.1f} % (one sigma)")
    return tuple(lines)


def _cameras(plan: Plan, predicted: Sigmas, simulated: Sigmas) -> tuple[str | Table | Drawing, ...]:
    network, unit = plan.network, plan.network.length_unit
    rows = [
        (image.name, *_cells(a, b, ".4f"))
        for image, a, b in zip(network.images, predicted.positions, simulated.positions, strict=True)
    ]
    both = "by covariance (by Monte Carlo)"
    parts: list[str | Table] = [
        f"Sigma of the positions ({unit}), {both}:",
        Table(("image", "X0", "Y0", "Z0"), tuple(rows)),
    ]
    parameters = parameters_of(plan)
    if parameters:
        inner = [
            (camera.name, *_cells(a, b, ".3g"))
            for camera, a, b in zip(network.cameras, predicted.interior, simulated.interior, strict=True)
        ]
        parts += [
            f"Sigma of the interior orientations (image unit), {both}:",
            Table(("camera", *parameters), tuple(inner)),
        ]
    return tuple(parts)


def _points(plan: Plan, flight: Flight, predicted: Sigmas, simulated: Sigmas) -> tuple[str | Table | Drawing, ...]:
    unit = plan.network.length_unit
    axes = ("X", "Y", "Z")
    pairs = [
        (mean_of_position(predicted.points), mean_of_position(simulated.points), f"Mean of {', '.join(flight.names)}")
    ]
    pairs += [(predicted.points[:, i], simulated.points[:, i], name) for i, name in enumerate(flight.names)]
    drawings = [_along(f"{words}, sigma of X, Y, Z", axes, a, b, unit) for a, b, words in pairs]
    table = _table(axes, pairs[0][0], pairs[0][1], ".4f")
    return (*drawings, f"Mean sigma of {', '.join(flight.names)} ({unit}), position by position:", table)


def _skis(flight: Flight, predicted: Sigmas, simulated: Sigmas) -> tuple[str | Table | Drawing, ...]:
    names = ", ".join(flight.ski_names)
    ours, theirs = (np.degrees(mean_of_position(sigmas.angles)) for sigmas in (predicted, simulated))
    head = ("slope", "heading")
    drawing = _along(f"Mean of {names}, sigma of slope and heading", head, ours, theirs, "degrees")
    return (drawing, f"Mean sigma of {names} (degrees), position by position:", _table(head, ours, theirs, ".3f"))


def _body(plan: Plan, predicted: Sigmas, simulated: Sigmas) -> tuple[str | Table | Drawing, ...]:
    unit = plan.network.length_unit
    ours, theirs = (np.degrees(sigmas.body[:, :-1]) for sigmas in (predicted, simulated))
    of_o, again = (np.column_stack((s.body[:, -1], np.append(s.speed, np.nan))) for s in (predicted, simulated))
    drawings = (
        _along("Sigma of alpha, beta, gamma", ANGLES[:3], ours[:, :3], theirs[:, :3], "degrees"),
        _along("Sigma of dphi and phi", ANGLES[3:], ours[:, 3:], theirs[:, 3:], "degrees"),
        _along("Sigma of the height of O, midway between the bindings", ("Z",), of_o[:, :1], again[:, :1], unit),
        _along("Sigma of the speed of O to the next position", ("speed",), of_o[:-1, 1:], again[:-1, 1:], f"{unit}/s"),
    )
    head = (*ANGLES, f"height ({unit})", f"speed ({unit}/s)")
    angles, others = _rows(ours, theirs, ".2f"), _rows(of_o, again, ".4f")
    rows = tuple((*one, *other[1:]) for one, other in zip(angles, others, strict=True))
    words = "Sigma of the angles (degrees), of the height of O, and of its speed to the next position:"
    return (*drawings, words, Table(("position", *head), rows))


def _along(words: str, names: Sequence[str], ours: Floats, theirs: Floats, unit: str) -> Drawing:
    """Curves (t, k) over the positions."""
    largest = rounded_up(1.05 * float(max(ours.max(), theirs.max())))
    x = np.arange(1.0, len(ours) + 1.0)
    chart = Chart((1.0, max(float(x[-1]), 2.0)), (0.0, largest), "position", f"sigma ({unit})")
    for name, colour, a, b in zip(names, _COLOURS, ours.T, theirs.T, strict=False):
        chart.curve(x, a, colour)
        chart.rings(x, b, colour)
        chart.legend(colour, name)
    caption = f"{words}; {_BOTH}."
    return Drawing(caption, chart.svg.rendered(caption))


def _table(head: Iterable[str], ours: Floats, theirs: Floats, form: str) -> Table:
    return Table(("position", *head), _rows(ours, theirs, form))


def _rows(ours: Floats, theirs: Floats, form: str) -> tuple[tuple[str, ...], ...]:
    return tuple((str(i), *_cells(a, b, form)) for i, (a, b) in enumerate(zip(ours, theirs, strict=True), 1))


def _cells(ours: Floats, theirs: Floats, form: str) -> list[str]:
    return [f"{a:{form}} ({b:{form}})" if np.isfinite(a) else "" for a, b in zip(ours, theirs, strict=True)]


def worst_disagreement(predicted: Sigmas, simulated: Sigmas) -> float:
    """Largest relative difference of the two methods among the figures of the tables (means of a position's points)."""
    pairs = [
        (predicted.positions, simulated.positions),
        (predicted.interior, simulated.interior),
        (mean_of_position(predicted.points), mean_of_position(simulated.points)),
        (mean_of_position(predicted.angles), mean_of_position(simulated.angles)),
        (predicted.body, simulated.body),
        (predicted.speed, simulated.speed),
    ]
    ratios = np.concatenate([(b[a > 0.0] / a[a > 0.0]).ravel() for a, b in pairs])
    return float(np.abs(ratios - 1.0).max(initial=0.0))


def plan_to_json(plan: Plan, predicted: Sigmas, simulated: Sigmas, samples: int) -> dict[str, Any]:
    """All figures: lengths in the file's unit, angles in degrees."""
    return {
        "format": "svev-plan/1",
        "name": plan.name,
        "length_unit": plan.network.length_unit,
        "samples": samples,
        "worst_disagreement": worst_disagreement(predicted, simulated),
        "covariance": _sigmas_to_json(plan, predicted),
        "monte_carlo": _sigmas_to_json(plan, simulated),
    }


def mean_of_position(values: Floats) -> Floats:
    """Means (positions, 2 or 3) over the points or skis of each position."""
    return values.mean(axis=1) if values.size else np.zeros((0, values.shape[-1]))


def parameters_of(plan: Plan) -> list[str]:
    """Names of the parameters that any camera estimates, in the order of `Sigmas.interior`."""
    return [name for name in INTERIOR if any(name in camera.estimate for camera in plan.network.cameras)]


def _sigmas_to_json(plan: Plan, sigmas: Sigmas) -> dict[str, Any]:
    network, parameters, flight = plan.network, parameters_of(plan), plan.flight
    out: dict[str, Any] = {
        "images": {image.name: s.tolist() for image, s in zip(network.images, sigmas.positions, strict=True)},
        "cameras": {
            camera.name: {p: float(s) for p, s in zip(parameters, row, strict=True) if p in camera.estimate}
            for camera, row in zip(network.cameras, sigmas.interior, strict=True)
        },
    }
    if flight is not None:
        out["positions"] = [_position_to_json(flight, sigmas, i) for i in range(len(sigmas.points))]
    return out


def _position_to_json(flight: Flight, sigmas: Sigmas, i: int) -> dict[str, Any]:
    position: dict[str, Any] = {
        "points": {name: s.tolist() for name, s in zip(flight.names, sigmas.points[i], strict=True)},
        "skis": {
            name: {"slope_deg": float(np.degrees(s[0])), "heading_deg": float(np.degrees(s[1]))}
            for name, s in zip(flight.ski_names, sigmas.angles[i], strict=True)
        },
    }
    if flight.stick is not None:
        position["body"] = {
            f"{name}_deg": float(np.degrees(s)) for name, s in zip(ANGLES, sigmas.body[i, :-1], strict=True)
        }
        position["height"] = float(sigmas.body[i, -1])
        if i < len(sigmas.speed):
            position["speed_to_next"] = float(sigmas.speed[i])
    return position


def flight_extras(plan: Plan, flight: Flight, adjusted: Adjustment) -> Extras:
    """Paths of all points; points, body and skis at every fourth position."""
    covariance = carry(plan, flight, adjusted).covariance
    shown = range(0, len(flight.points), _EVERY)
    places = [
        Place(
            "",
            flight.points[t, p],
            covariance[t, 3 * p : 3 * p + 3, 3 * p : 3 * p + 3],
            Colour.AMBER,
        )
        for t in shown
        for p in range(len(flight.names))
    ]
    tracks = [Track(flight.points[:, p], Colour.FAINT) for p in range(len(flight.names))]
    tracks += [Track(flight.skis[t, s], Colour.AMBER, 1.4) for t in shown for s in range(len(flight.ski_names))]
    tracks += [Track(_helmet_hip_origin(flight, t), Colour.AMBER, 1.4) for t in shown if flight.stick is not None]
    tied = frozenset(int(point) for point in flight.tie[flight.tie >= 0])
    words = f" and jumper (amber) at every {_EVERY}th of {len(flight.points)} positions,"
    return Extras(tuple(places), tuple(tracks), words, tied)


def _helmet_hip_origin(flight: Flight, position: int) -> Floats:
    """Line (3, 3) through helmet, hip and O."""
    points, stick = flight.points[position], flight.stick
    if stick is None:
        raise ValueError("a flight without a stick model has no body")
    return np.stack((points[stick.helmet], points[stick.hip], points[list(stick.bindings)].mean(axis=0)))
