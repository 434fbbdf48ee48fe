"""An adjustment on one screen, for people."""

import numpy as np

from photogrammetry.adjustment.adjustment import Adjustment
from photogrammetry.adjustment.result_file import status_of
from photogrammetry.adjustment.run import Outcome
from photogrammetry.adjustment.wording import describe
from photogrammetry.network import ImageFrame, Role

_SHOWN = 5  # gross errors that stand on the screen
_INSIGNIFICANT = 1.96


def summarise(outcome: Outcome) -> list[str]:
    """Lines that say what came out, what is doubtful, and what to look at."""
    a = outcome.adjustment
    lines = [status_of(outcome), _counts(a)]
    if a.sigma0 is not None:
        lines.append(_verdict(a))
    lines += _camera_lines(a) + _point_lines(a) + _component_lines(outcome)
    if outcome.removed:
        lines.append(f"taken out ({len(outcome.removed)}):")
        lines += [f"  {describe(gone.network, gone.blunder)}" for gone in outcome.removed[:_SHOWN]]
        lines += _more(len(outcome.removed))
    if outcome.blunders:
        lines.append(f"suspected gross errors ({len(outcome.blunders)}), the first is the suspect:")
        lines += [f"  {describe(a.network, blunder)}" for blunder in outcome.blunders[:_SHOWN]]
        lines += _more(len(outcome.blunders))
    elif a.redundancy:
        lines.append("no gross error is suspected")
    return lines


def _more(count: int) -> list[str]:
    return [f"  and {count - _SHOWN} more in the result file"] if count > _SHOWN else []


def _counts(a: Adjustment) -> str:
    conditions = f" + {a.free.defect} datum conditions" if a.free.defect else ""
    return (
        f"{a.problem.n_observations} observations - {a.problem.unknowns.count} unknowns{conditions} "
        f"= redundancy {a.redundancy}; {len(a.network.images)} images, {len(a.network.points)} points"
    )


def _verdict(a: Adjustment) -> str:
    ratio = a.ratio
    if ratio > 1.0:
        words = f"the observations are {ratio:.2f} times less accurate than their sigmas say"
    else:
        words = f"the observations are {1.0 / max(ratio, 1e-12):.2f} times more accurate than their sigmas say"
    return f"sigma0 {a.sigma0:.5g} (a priori {a.network.sigma0:g}): {words}"


def _camera_lines(a: Adjustment) -> list[str]:
    lines, unknowns = [], a.problem.unknowns
    for i, camera in enumerate(a.network.cameras):
        columns = unknowns.camera[i][unknowns.camera[i] >= 0]
        sigmas = a.sigmas(columns)
        values = a.state.interior[i][unknowns.selection[unknowns.camera[i] >= 0]]
        parts = []
        for name, value, sigma in zip(camera.estimate, values, sigmas, strict=True):
            doubt = " (not significant)" if name != "c" and abs(value) < _INSIGNIFICANT * sigma else ""
            parts.append(f"{name} {value:.6g} ± {sigma:.2g}{doubt}")
        if parts:
            lines.append(f"camera {camera.name}: " + ", ".join(parts))
    return lines


def _point_lines(a: Adjustment) -> list[str]:
    """Typical and worst accuracy of positions and points."""
    lines, unit = [], a.network.length_unit
    known = a.problem.unknowns.point[:, 0] >= 0
    if np.any(known):
        sigma = np.linalg.norm(a.sigmas(a.problem.unknowns.point[known]), axis=1)
        worst = np.flatnonzero(known)[int(np.argmax(sigma))]
        name = a.network.points[worst].name
        lines.append(f"points: sigma {np.median(sigma):.3g} {unit} (median), worst {sigma.max():.3g} at {name}")
    posed = a.problem.unknowns.pose[:, 0] >= 0
    if np.any(posed):
        sigma = np.linalg.norm(a.sigmas(a.problem.unknowns.pose[posed][:, :3]), axis=1)
        worst = np.flatnonzero(posed)[int(np.argmax(sigma))]
        name = a.network.images[worst].name
        lines.append(
            f"positions: sigma {np.median(sigma):.3g} {unit} (median), worst {sigma.max():.3g} at image {name}"
        )
    checks = [i for i, point in enumerate(a.network.points) if point.role is Role.CHECK]
    deltas = [a.state.xyz[i] - point.xyz for i in checks if (point := a.network.points[i]).xyz is not None]
    if deltas:
        root = np.sqrt(np.mean(np.square(deltas), axis=0))
        lines.append(
            f"{len(deltas)} check points: rms X Y Z " + " ".join(f"{value:.3g}" for value in root) + f" {unit}"
        )
    return lines


def _component_lines(outcome: Outcome) -> list[str]:
    network = outcome.adjustment.network
    unit = {"control": network.length_unit, "distance": network.length_unit, "difference": network.length_unit}
    image_unit = "px" if network.image_frame is ImageFrame.PIXEL else ""
    parts = []
    for part in outcome.components or ():
        if part.factor is None:
            parts.append(f"{part.group} not controlled")
        elif part.sigma is None:
            parts.append(f"{part.group} {part.factor:.3g} x a priori (redundancy {part.redundancy:.1f})")
        else:
            size = f"{part.sigma:.3g} {unit.get(part.group, image_unit)}".strip()
            parts.append(f"{part.group} {size} (redundancy {part.redundancy:.1f})")
    return [f"estimated accuracy of the observations: {'; '.join(parts)}"] if parts else []
