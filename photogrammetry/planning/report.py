"""What a plan says, for people and as JSON."""

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from photogrammetry.camera_model import INTERIOR
from photogrammetry.jumper.stick_model import ANGLES
from photogrammetry.planning.plan import Flight, Plan
from photogrammetry.planning.prediction import Sigmas

Floats = NDArray[np.float64]


def worst_disagreement(predicted: Sigmas, simulated: Sigmas) -> float:
    """Largest difference of the two methods, relative; of each figure of the tables (means of a position's points)."""
    pairs = [
        (predicted.positions, simulated.positions),
        (predicted.interior, simulated.interior),
        (_mean(predicted.points), _mean(simulated.points)),
        (_mean(predicted.angles), _mean(simulated.angles)),
        (predicted.body, simulated.body),
        (predicted.speed, simulated.speed),
    ]
    ratios = np.concatenate([(b[a > 0.0] / a[a > 0.0]).ravel() for a, b in pairs])
    return float(np.abs(ratios - 1.0).max(initial=0.0))


def plan_to_json(plan: Plan, predicted: Sigmas, simulated: Sigmas, samples: int) -> dict[str, Any]:
    """Everything, lengths in the file's unit, angles in degrees."""
    return {
        "format": "svev-plan/1",
        "name": plan.name,
        "length_unit": plan.network.length_unit,
        "samples": samples,
        "worst_disagreement": worst_disagreement(predicted, simulated),
        "covariance": _sigmas_to_json(plan, predicted),
        "monte_carlo": _sigmas_to_json(plan, simulated),
    }


def plan_table(plan: Plan, predicted: Sigmas, simulated: Sigmas) -> list[str]:
    """Lines for people: by covariance, and in brackets by Monte Carlo."""
    unit = plan.network.length_unit
    lines = [plan.name, "", f"cameras: sigma of X0, Y0, Z0 ({unit}), by covariance (by Monte Carlo)"]
    for i, image in enumerate(plan.network.images):
        lines.append(f"  {image.name:<10}" + _row(predicted.positions[i], simulated.positions[i], "9.4f"))
    parameters = _parameters(plan)
    if parameters:
        lines += ["", f"interior orientation: sigma of {', '.join(parameters)} (image unit)"]
        for i, camera in enumerate(plan.network.cameras):
            lines.append(f"  {camera.name:<10}" + _row(predicted.interior[i], simulated.interior[i], "9.3g"))
    if plan.flight is None:
        return lines
    names = ", ".join(plan.flight.names)
    lines += ["", f"jumper: mean sigma of X, Y, Z ({unit}) of {names}, position by position"]
    for i, (ours, theirs) in enumerate(zip(_mean(predicted.points), _mean(simulated.points), strict=True), 1):
        lines.append(f"  {i:<10}" + _row(ours, theirs, "9.4f"))
    if plan.flight.ski_names:
        lines += ["", f"skis: mean sigma of slope, heading (degrees) of {', '.join(plan.flight.ski_names)}"]
        pairs = zip(np.degrees(_mean(predicted.angles)), np.degrees(_mean(simulated.angles)), strict=True)
        lines += [f"  {i:<10}" + _row(ours, theirs, "9.3f") for i, (ours, theirs) in enumerate(pairs, 1)]
    if plan.flight.stick is not None:
        lines += ["", f"body: sigma of {', '.join(ANGLES)} (degrees)"]
        bodies = zip(np.degrees(predicted.body[:, :-1]), np.degrees(simulated.body[:, :-1]), strict=True)
        lines += [f"  {i:<10}" + _row(ours, theirs, "6.2f") for i, (ours, theirs) in enumerate(bodies, 1)]
        lines += [
            "",
            f"O, midway between the bindings: sigma of height ({unit}) and of speed to the next place ({unit}/s)",
        ]
        ours, theirs = (
            np.column_stack((sigmas.body[:, -1], np.append(sigmas.speed, np.nan))) for sigmas in (predicted, simulated)
        )
        lines += [f"  {i:<10}" + _row(a[:k], b[:k], "9.4f") for i, k, a, b in _numbered(ours, theirs)]
    return lines


def _numbered(ours: Floats, theirs: Floats) -> Iterator[tuple[int, int, Floats, Floats]]:
    """Number, how many figures are known, and the figures of each position."""
    for i, (a, b) in enumerate(zip(ours, theirs, strict=True), 1):
        yield i, int(np.isfinite(a).sum()), a, b


def _row(ours: Floats, theirs: Floats, form: str) -> str:
    return "  ".join(f"{a:{form}} ({b:{form}})" for a, b in zip(ours, theirs, strict=True))


def _mean(values: Floats) -> Floats:
    """Over the points or skis of a position; (positions, 2 or 3)."""
    return values.mean(axis=1) if values.size else np.zeros((0, values.shape[-1]))


def _parameters(plan: Plan) -> list[str]:
    return [name for name in INTERIOR if any(name in camera.estimate for camera in plan.network.cameras)]


def _sigmas_to_json(plan: Plan, sigmas: Sigmas) -> dict[str, Any]:
    network, parameters, flight = plan.network, _parameters(plan), plan.flight
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
