"""Sections of a report that every adjustment has: parameters with sigma, correlations, residuals, findings."""

from itertools import combinations

import numpy as np

from photogrammetry.adjustment.equations.relations import Kind
from photogrammetry.adjustment.gross_errors.blunders import BlunderKind, Observation, in_file_frame, name_of
from photogrammetry.adjustment.run import Outcome
from photogrammetry.adjustment.solution.adjustment import Adjustment
from photogrammetry.adjustment.solution.statistics import correlation
from photogrammetry.geometry.camera_model import INTERIOR
from photogrammetry.network.model import Role
from photogrammetry.reports.document import Section, Table
from photogrammetry.reports.drawing.network import network_drawings
from photogrammetry.reports.drawing.residuals import residual_drawings
from photogrammetry.reports.summary import summarise

_STRONG = 0.9  # larger correlations are listed
_SHOWN = 20  # listed correlations, at most
_POSE = ("X0", "Y0", "Z0", "angle 1", "angle 2", "angle 3")


def adjusted_sections(outcome: Outcome) -> tuple[Section, ...]:
    """The common sections of an adjusted network."""
    a = outcome.adjustment
    sections = [
        Section("Summary", tuple(summarise(outcome))),
        Section("Network", network_drawings(a)),
        Section("Interior orientation", _interior(a)),
        Section("Poses", _poses(a)),
        Section("Points", _points(a)),
        Section("Correlations", _correlations(a)),
        Section("Residuals", (*residual_drawings(a), *_residuals(a))),
    ]
    return tuple(section for section in sections if section.parts)


def _interior(a: Adjustment) -> tuple[str | Table, ...]:
    rows = []
    for i, camera in enumerate(a.network.cameras):
        for p in a.parameters(i)[0]:
            significant = "" if p.name == "c" else "no" if p.insignificant else "yes"
            rows.append((f"{camera.name} {p.name}", f"{p.value:.6g}", f"{p.sigma:.2g}", significant))
    if rows:
        return (Table(("parameter", "value", "sigma", "significant"), tuple(rows)),)
    given = tuple((camera.name, f"{camera.interior[0]:.6g}") for camera in a.network.cameras)
    return ("Constant, free of error.", Table(("camera", "c"), given))


def _poses(a: Adjustment) -> tuple[str | Table, ...]:
    sigma = a.sigmas(a.problem.unknowns.pose)
    rows = []
    for i, image in enumerate(a.network.images):
        place = [f"{value:.4f}" for value in a.state.position[i]]
        spread = [f"{value:.2g}" for value in (*sigma[i, :3], *np.degrees(sigma[i, 3:]) * 60.0)]
        rows.append((image.name, *place, *spread))
    unit = a.length_unit
    head = ("image", "X0", "Y0", "Z0", *(f"sigma {name}" for name in _POSE))
    return (
        f"Lengths in {unit or 'length units'}, angles about the camera's own axes in minutes.",
        Table(head, tuple(rows)),
    )


def _points(a: Adjustment) -> tuple[str | Table, ...]:
    sigma = a.sigmas(a.problem.unknowns.point)
    count = np.bincount(a.problem.point, minlength=len(a.network.points))
    rows = [
        (
            point.name,
            point.role.value,
            str(count[i]),
            *(f"{value:.4f}" for value in a.state.xyz[i]),
            *(f"{value:.2g}" for value in sigma[i]),
        )
        for i, point in enumerate(a.network.points)
    ]
    return (Table(("point", "role", "rays", "X", "Y", "Z", "sigma X", "sigma Y", "sigma Z"), tuple(rows)),)


def _correlations(a: Adjustment) -> tuple[str | Table, ...]:
    """Strong correlations among interior orientation and pose of each image."""
    found = {}
    for image, columns in enumerate(a.problem.global_columns()):
        names = _names(a, image)
        known = columns >= 0
        matrix = correlation(a.covariance(columns[known]))
        chosen = [name for name, there in zip(names, known, strict=True) if there]
        for (i, one), (j, other) in combinations(enumerate(chosen), 2):
            if abs(matrix[i, j]) >= _STRONG:
                found[one, other] = float(matrix[i, j])
    if not found:
        return (f"None of interior orientation and poses reaches {_STRONG:g}.",)
    strongest = sorted(found.items(), key=lambda item: -abs(item[1]))
    rows = tuple((one, other, f"{value:.3f}") for (one, other), value in strongest[:_SHOWN])
    words = f"{len(found)} among interior orientation and pose reach {_STRONG:g}"
    return (f"{words}; the strongest:" if len(found) > _SHOWN else f"{words}:", Table(("one", "other", "r"), rows))


def _names(a: Adjustment, image: int) -> list[str]:
    camera = a.network.cameras[a.network.images[image].camera].name
    interior = [f"{camera} {INTERIOR[i]}" for i in a.problem.unknowns.selection]
    return [*interior, *(f"{a.network.images[image].name} {name}" for name in _POSE)]


def _residuals(a: Adjustment) -> tuple[str | Table, ...]:
    """Residuals by images, of surveyed points, of distances and differences."""
    v = in_file_frame(a.network, a.image_residuals())
    w = np.nan_to_num(np.abs(a.image_w()))
    r = a.controlled.image_numbers
    rows = []
    for i, image in enumerate(a.network.images):
        rows_of = slice(a.problem.start[i], a.problem.start[i + 1])
        if len(v[rows_of]):
            root = np.sqrt(np.mean(v[rows_of] ** 2, axis=0))
            worst = f"{w[rows_of].max():.1f}"
            rows.append(
                (
                    image.name,
                    str(len(v[rows_of])),
                    f"{root[0]:.3g}",
                    f"{root[1]:.3g}",
                    f"{r[rows_of].mean():.2f}",
                    worst,
                )
            )
    head = ("image", "points", "rms vx", "rms vy", "mean r", "largest |w|")
    parts: list[str | Table] = [f"Images ({a.network.image_unit}):", Table(head, tuple(rows))]
    checks = [
        (point.name, *(f"{value:.3g}" for value in a.state.xyz[i] - point.xyz))
        for i, point in enumerate(a.network.points)
        if point.role in (Role.CONTROL, Role.CHECK) and point.xyz is not None
    ]
    if checks:
        parts += ["Surveyed points, adjusted - given:", Table(("point", "vX", "vY", "vZ"), tuple(checks))]
    measured = [
        *_measured(a, Kind.DISTANCE, BlunderKind.DISTANCE),
        *_measured(a, Kind.DIFFERENCE, BlunderKind.DIFFERENCE),
    ]
    if measured:
        parts += ["Distances and differences:", Table(("observation", "v", "r", "w"), tuple(measured))]
    return tuple(parts)


def _measured(a: Adjustment, kind: Kind, name: BlunderKind) -> list[tuple[str, ...]]:
    """Residual, redundancy number and test value of distances or differences."""
    return [
        (name_of(a.network, Observation(name, item)), f"{v:.3g}", f"{r:.2f}", f"{w:.1f}" if np.isfinite(w) else "")
        for item, _, v, r, w in a.relation_tests(kind)
    ]
