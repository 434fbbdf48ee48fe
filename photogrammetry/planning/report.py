"""What a plan says, as JSON, and how far its two predictions differ."""

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
        (mean_of_position(predicted.points), mean_of_position(simulated.points)),
        (mean_of_position(predicted.angles), mean_of_position(simulated.angles)),
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


def mean_of_position(values: Floats) -> Floats:
    """Over the points or skis of a position; (positions, 2 or 3)."""
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
