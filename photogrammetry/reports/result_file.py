"""Writes `svev-adjustment/1` files (contract `network.md`)."""

import json
import math
from collections.abc import Mapping, Sequence
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from photogrammetry.adjustment.equations.relations import Kind
from photogrammetry.adjustment.gross_errors.blunders import blunder_to_json, in_file_frame
from photogrammetry.adjustment.run import Outcome
from photogrammetry.adjustment.solution.adjustment import Adjustment
from photogrammetry.adjustment.solution.global_test import GlobalTest
from photogrammetry.adjustment.solution.usability import is_unusable
from photogrammetry.geometry.camera_model import INTERIOR
from photogrammetry.network.diagnosis import Defect
from photogrammetry.network.model import AXES, Reweight, Role
from rig.arrays import Floats

FORMAT = "svev-adjustment/1"
#: The elements of a pose: projection centre, and turns (rad) about the camera's own axes.
POSE = ("X0", "Y0", "Z0", "angle1", "angle2", "angle3")
_WEIGHTS = {
    Reweight.NONE: "",
    Reweight.HELMERT: "; the weights are estimated from the residuals, group by group",
    Reweight.PAPER: "; the weights are estimated by D5 as the paper prints it",
}


def write_result(result: Mapping[str, Any], path: Path) -> None:
    """Write a result file."""
    path.write_text(result_text(result), encoding="utf-8")


def result_text(result: Mapping[str, Any]) -> str:
    """The text of a result file."""
    return json.dumps(result, allow_nan=False) + "\n"


def failure_to_json(status: str, defects: Sequence[Defect] = ()) -> dict[str, Any]:
    """The result of a network that could not be adjusted: status and diagnosis, no numbers."""
    return {
        "format": FORMAT,
        "converged": False,
        "status": status,
        "diagnosis": [
            {
                "kind": defect.kind.value,
                "defect": defect.defect,
                "points": list(defect.points),
                "images": list(defect.images),
                "message": defect.message,
            }
            for defect in defects
        ],
    }


def outcome_to_json(outcome: Outcome) -> dict[str, Any]:
    """The whole result file of an adjusted network."""
    a = outcome.adjustment
    network = a.network
    result: dict[str, Any] = {
        "format": FORMAT,
        "converged": True,
        "iterations": a.iterations,
        "status": status_of(outcome),
        "sigma0": a.sigma0,
        "vTPv": a.vtpv,
        "n_observations": a.problem.n_observations,
        "n_unknowns": a.problem.unknowns.count,
        "n_conditions": a.free.defect,
        "redundancy": a.redundancy,
        "global_test": _global_test(a),
        "length_unit": "" if a.scale_is_free else network.length_unit,
        **({} if network.ball_radius_m is None else {"ball_radius_m": network.ball_radius_m}),
        "image_frame": network.image_frame.value,
        "cameras": _cameras(outcome),
        "images": _images(a),
        "points": _points(a),
        "check_points": _check_points(a),
        "observations": _observations(a),
        "control": _control(a),
        "distances": _relations(a, Kind.DISTANCE),
        "differences": _relations(a, Kind.DIFFERENCE),
        "weighted_parameters": _weighted_parameters(a),
        "gross_errors": [blunder_to_json(one.network, one.blunder) for one in outcome.suspected],
        "variance_components": {
            part.group: {"factor": part.factor, "sigma": part.sigma, "redundancy": part.redundancy}
            for part in outcome.components or ()
        },
        "diagnosis": [],
    }
    if a.network.images and len({image.camera for image in network.images}) == len(network.images):
        result["calibration"] = _calibration(a)
    if outcome.removed:
        result["removed"] = [blunder_to_json(gone.network, gone.blunder) for gone in outcome.removed]
    return result


def _global_test(a: Adjustment) -> dict[str, Any]:
    test = GlobalTest(a.ratio, a.redundancy)
    numbers = {"ratio": a.ratio, "scale": a.scale, "probability": test.chance}
    return numbers | {"verdict": test.verdict.value, "words": test.words, "usable": not is_unusable(a)}


def status_of(outcome: Outcome) -> str:
    """The status of the result in words: iterations, doubts, weights."""
    a = outcome.adjustment
    words = f"converged after {a.iterations} iterations"
    if a.redundancy == 0:
        words += "; nothing is redundant: sigma0 cannot be estimated, all sigmas are a priori and nothing is checked"
    behind = a.problem.behind(a.state)
    if behind:
        words += f"; {behind} observed points lie behind their cameras: check the start values and the rotations' sense"
    if is_unusable(a):
        words += f"; not to be used: sigma0 is {GlobalTest(a.ratio, a.redundancy).words}"
    if outcome.intervals:
        doubtful = ", ".join(f"{one.camera} {one.parameter.name}" for one in outcome.intervals)
        words += f"; the sigmas do not hold for parameters beyond their linearisation: {doubtful}"
    words += _WEIGHTS[a.network.reweight]
    if outcome.components is None:
        words += "; the variance components do not settle"
    return words


def _numbers(values: Floats) -> list[float | None]:
    """A list for JSON; NaN and infinity become null."""
    return [value if math.isfinite(value) else None for value in np.asarray(values, dtype=float).tolist()]


def _number(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _cameras(outcome: Outcome) -> dict[str, Any]:
    a, out = outcome.adjustment, {}
    for i, camera in enumerate(a.network.cameras):
        parameters, correlations = a.parameters(i)
        out[camera.name] = {
            **dict(zip(INTERIOR, a.state.interior[i].tolist(), strict=True)),
            "r0": camera.balance,
            "distortion": camera.distortion.value,
            **({} if camera.size is None else {"size": list(camera.size)}),
            "sigma": {p.name: p.sigma for p in parameters},
            "correlations": {
                f"{one.name}|{other.name}": _number(correlations[j, k])
                for (j, one), (k, other) in combinations(enumerate(parameters), 2)
            },
            # the test value of "this parameter is zero", which makes no sense for c
            "significance": {
                p.name: abs(p.value) / p.sigma if p.sigma > 0.0 else None for p in parameters if p.name != "c"
            },
            # 95 %, where the sigma does not tell it
            "interval": {
                one.parameter.name: [_number(one.low), _number(one.high)]
                for one in outcome.intervals
                if one.camera == camera.name
            },
        }
    return out


def _images(a: Adjustment) -> dict[str, Any]:
    sigma = a.sigmas(a.problem.unknowns.pose)
    return {
        image.name: {
            "camera": a.network.cameras[image.camera].name,
            "X0": a.state.position[i].tolist(),
            "R": a.state.rotation[i].tolist(),
            "sigma_X0": sigma[i, :3].tolist(),
            "sigma_angles": sigma[i, 3:].tolist(),
        }
        for i, image in enumerate(a.network.images)
    }


def _calibration(a: Adjustment) -> dict[str, Any]:
    """The joint covariance of all poses and interior parameters that were estimated, of one image of each camera."""
    unknowns, network = a.problem.unknowns, a.network
    named: list[tuple[dict[str, str], int]] = []
    for image, columns in zip(network.images, unknowns.pose, strict=True):
        named += [
            ({"image": image.name, "parameter": p}, c) for p, c in zip(POSE, columns.tolist(), strict=True) if c >= 0
        ]
    for camera, columns in zip(network.cameras, unknowns.camera, strict=True):
        parameters = [INTERIOR[i] for i in unknowns.selection]
        named += [
            ({"camera": camera.name, "parameter": p}, c)
            for p, c in zip(parameters, columns.tolist(), strict=True)
            if c >= 0
        ]
    columns = np.array([column for _, column in named], dtype=np.intp)
    return {"parameters": [name for name, _ in named], "covariance": a.covariance(columns).tolist()}


def _points(a: Adjustment) -> dict[str, Any]:
    columns = a.problem.unknowns.point
    sigma, covariance = a.sigmas(columns), a.covariance(columns)
    rays = np.bincount(a.problem.point, minlength=len(columns))
    return {
        point.name: {
            "X": a.state.xyz[i].tolist(),
            "sigma": sigma[i].tolist(),
            "covariance": covariance[i].tolist(),
            "rays": int(rays[i]),
        }
        for i, point in enumerate(a.network.points)
    }


def _check_points(a: Adjustment) -> dict[str, Any]:
    sigma, out = a.sigmas(a.problem.unknowns.point), {}
    for i, point in enumerate(a.network.points):
        if point.role is Role.CHECK and point.xyz is not None:
            out[point.name] = {"delta": (a.state.xyz[i] - point.xyz).tolist(), "sigma": sigma[i].tolist()}
    return out


def _observations(a: Adjustment) -> list[dict[str, Any]]:
    """Image residuals in the order of the file, along the axes of its frame."""
    network, back = a.network, np.argsort(a.problem.order)
    v = in_file_frame(network, a.image_residuals())[back].tolist()
    w = in_file_frame(network, a.image_w())[back]
    r = a.controlled.image_numbers[back].tolist()
    sigma = a.problem.sigma[back].tolist()
    return [
        {
            "image": network.images[image].name,
            "point": network.points[point].name,
            "vx": v[i][0],
            "vy": v[i][1],
            "rx": r[i][0],
            "ry": r[i][1],
            "wx": _number(w[i, 0]),
            "wy": _number(w[i, 1]),
            "sigma": sigma[i],
        }
        for i, (image, point) in enumerate(zip(network.observations.image, network.observations.point, strict=True))
    ]


def _control(a: Adjustment) -> list[dict[str, Any]]:
    relations = a.problem.relations
    v, r, w = a.relation_residuals(), a.controlled.relation, a.relation_w()
    return [
        {
            "point": a.network.points[relations.item[rows[0]]].name,
            "v": v[rows].tolist(),
            "r": r[rows].tolist(),
            "w": _numbers(w[rows]),
        }
        for rows in relations.rows(Kind.CONTROL).reshape(-1, 3)
    ]


def _relations(a: Adjustment, kind: Kind) -> list[dict[str, Any]]:
    network, out = a.network, []
    for item, part, v, r, w in a.relation_tests(kind):
        relation = network.distances[item] if kind is Kind.DISTANCE else network.differences[item]
        entry: dict[str, Any] = {"from": network.points[relation.start].name, "to": network.points[relation.end].name}
        if kind is Kind.DIFFERENCE:
            entry["axis"] = AXES[part]
        out.append(entry | {"v": v, "r": r, "w": _number(w)})
    return out


def _weighted_parameters(a: Adjustment) -> list[dict[str, Any]]:
    """Camera parameters and pose elements that were observed."""
    out = []
    for kind, of, parts, named in (
        (Kind.CAMERA, "camera", INTERIOR, a.network.cameras),
        (Kind.POSE, "image", POSE, a.network.images),
    ):
        for item, part, v, r, w in a.relation_tests(kind):
            out.append({of: named[item].name, "parameter": parts[part], "v": v, "r": r, "w": _number(w)})
    return out
