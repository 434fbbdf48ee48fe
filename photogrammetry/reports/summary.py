"""Sums an adjustment up in a screenful of lines."""

import numpy as np

from photogrammetry.adjustment.gross_errors.blunders import describe
from photogrammetry.adjustment.run import Outcome
from photogrammetry.adjustment.solution.adjustment import Adjustment
from photogrammetry.adjustment.solution.global_test import GlobalTest, Verdict
from photogrammetry.network.model import ImageFrame, Role
from photogrammetry.reports.result_file import status_of
from rig.arrays import Integers

_SHOWN = 5  # gross errors, at most


def summarise(outcome: Outcome) -> list[str]:
    """Lines with status, accuracy, doubtful parameters and suspected gross errors."""
    a = outcome.adjustment
    lines = [status_of(outcome), _counts(a)]
    if a.sigma0 is not None:
        lines.append(_verdict(a))
    lines += [
        *_camera_lines(a),
        *(one.words for one in outcome.intervals),
        *_point_lines(a),
        *_component_lines(outcome),
    ]
    if outcome.removed:
        lines.append(f"taken out ({len(outcome.removed)}):")
        lines += [f"  {describe(gone.network, gone.blunder)}" for gone in outcome.removed[:_SHOWN]]
        lines += _more(len(outcome.removed))
    if suspected := outcome.suspected:
        lines.append(f"suspected gross errors ({len(suspected)}), the first is the suspect:")
        lines += [f"  {describe(one.network, one.blunder)}" for one in suspected[:_SHOWN]]
        lines += _more(len(suspected))
    elif a.redundancy and GlobalTest(a.ratio, a.redundancy).verdict in (Verdict.AGREES, Verdict.SMALLER):
        lines.append("no gross error is suspected")
    elif a.redundancy:
        lines.append("no single observation explains the residuals")
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
    words = GlobalTest(a.ratio, a.redundancy).words
    return f"sigma0 {a.sigma0:.5g} (a priori {a.network.sigma0:g}): {words}"


def _camera_lines(a: Adjustment) -> list[str]:
    lines = []
    for i, camera in enumerate(a.network.cameras):
        parts = [
            f"{p.name} {p.value:.6g} ± {p.sigma:.2g}{' (not significant)' if p.insignificant else ''}"
            for p in a.parameters(i)[0]
        ]
        if parts:
            lines.append(f"camera {camera.name}: " + ", ".join(parts))
    return lines


def _point_lines(a: Adjustment) -> list[str]:
    """Median and worst sigma of points and positions; rms of the check points."""
    unknowns, unit = a.problem.unknowns, a.length_unit
    lines = _spread_lines(a, "points", "", unknowns.point, [point.name for point in a.network.points])
    lines += _spread_lines(a, "positions", "image ", unknowns.pose[:, :3], [image.name for image in a.network.images])
    deltas = [
        a.state.xyz[i] - point.xyz
        for i, point in enumerate(a.network.points)
        if point.role is Role.CHECK and point.xyz is not None
    ]
    if deltas:
        root = np.sqrt(np.mean(np.square(deltas), axis=0))
        lines.append(
            f"{len(deltas)} check points: rms X Y Z " + " ".join(f"{value:.3g}" for value in root) + f" {unit}"
        )
    return lines


def _spread_lines(a: Adjustment, what: str, kind: str, columns: Integers, names: list[str]) -> list[str]:
    """Median and worst of the sigmas of places (n, 3), as far as these are unknown."""
    known = columns[:, 0] >= 0
    if not np.any(known):
        return []
    sigma = np.linalg.norm(a.sigmas(columns[known]), axis=1)
    worst = names[np.flatnonzero(known)[int(np.argmax(sigma))]]
    median = f"{np.median(sigma):.3g} {a.length_unit}"
    return [f"{what}: sigma {median} (median), worst {sigma.max():.3g} at {kind}{worst}"]


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
