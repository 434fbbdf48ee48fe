"""What an adjustment assumed a priori: accuracies, datum, constants, risks."""

from collections.abc import Iterator

import numpy as np

from photogrammetry.adjustment.equations.relations import Kind
from photogrammetry.adjustment.gross_errors.suspicion import FAMILY_RISK
from photogrammetry.adjustment.solution.adjustment import Adjustment
from photogrammetry.adjustment.solution.global_test import GLOBAL_RISK
from photogrammetry.geometry.camera_model import INTERIOR
from photogrammetry.network.model import AXES, DatumType, Network, Reweight, Role
from photogrammetry.reports.document import Table
from photogrammetry.reports.result_file import POSE
from rig.arrays import Floats

_NAMED = 12  # points that are listed by name


def assumptions(a: Adjustment) -> tuple[str | Table, ...]:
    """A-priori standard deviations of all kinds of observations, and what was held."""
    network = a.network
    weights = {
        Reweight.NONE: "weights (sigma0 / sigma)^2 as given",
        Reweight.HELMERT: "weights estimated from the residuals, group by group, from these sigmas on",
        Reweight.PAPER: "weights estimated by D5 as the paper prints it, from these sigmas on",
    }[network.reweight]
    rows = (*_image_rows(network), *_relation_rows(a))
    return (
        f"sigma0 a priori {network.sigma0:g}; {weights}",
        Table(("observed", "count", "smallest sigma", "largest sigma", "unit"), rows),
        *_held(network),
        _datum(a),
        f"risk of the global test {GLOBAL_RISK:.0%}, that anything is suspected in sound data {FAMILY_RISK:.0%}",
        "all sigmas below are a posteriori: they carry the estimated sigma0",
        *_pooled(a),
    )


def _pooled(a: Adjustment) -> Iterator[str]:
    """What the sigmas carry instead of the estimated sigma0, if few observations are redundant."""
    if a.scale > a.ratio:
        carried = f"{a.scale * a.network.sigma0:.3g} instead of {a.sigma0:.3g}"
        yield f"few observations are redundant; the a-priori variance counts as four more: they carry {carried}"


def _image_rows(network: Network) -> Iterator[tuple[str, ...]]:
    o = network.observations
    for i, group in enumerate(o.groups):
        sigma = o.sigma[o.group == i]
        if len(sigma):
            name = "image points" if group == "image" else f"image points, group {group}"
            yield (name, str(len(sigma)), *_range(sigma), network.image_unit)


def _relation_rows(a: Adjustment) -> Iterator[tuple[str, ...]]:
    relations, network = a.problem.relations, a.network
    unit = network.length_unit or "length units"
    units = (
        dict.fromkeys(INTERIOR, "-") | dict.fromkeys(INTERIOR[:3], network.image_unit) | dict.fromkeys(POSE[3:], "rad")
    )
    for kind, parts, words in (
        (Kind.CONTROL, AXES, "surveyed {}"),
        (Kind.DISTANCE, ("distance",), "{}"),
        (Kind.DIFFERENCE, AXES, "difference {}"),
        (Kind.CAMERA, INTERIOR, "interior orientation, {}"),
        (Kind.POSE, POSE, "pose, {}"),
    ):
        rows = relations.rows(kind)
        of = relations.part[rows]
        for part in np.unique(of):
            sigma = relations.sigma[rows[of == part]]
            yield (words.format(parts[part]), str(len(sigma)), *_range(sigma), units.get(parts[part], unit))


def _range(sigma: Floats) -> tuple[str, str]:
    return f"{sigma.min():.4g}", f"{sigma.max():.4g}"


def _held(network: Network) -> Iterator[str]:
    roles = [(role, [point.name for point in network.points if point.role is role]) for role in Role]
    yield "points: " + ", ".join(f"{len(names)} {role.value}" for role, names in roles if names)
    for role, names in roles:
        if names and role is Role.FIXED:
            yield f"free of error: {_listed(names)}"
    constant = [image.name for image in network.images if not image.estimate]
    if constant:
        yield f"poses held as they are given: {_listed(constant)}"
    held = [camera.name for camera in network.cameras if not camera.estimate]
    if held:
        yield f"interior orientations held as they are given, free of error: {', '.join(held)}"


def _datum(a: Adjustment) -> str:
    datum = a.network.datum
    if datum.type is DatumType.CONTROL:
        return "datum: control points, distances and differences"
    points = "all points" if datum.points is None else _listed([a.network.points[i].name for i in datum.points])
    scale = "; nothing gives the scale" if a.scale_is_free else ""
    return f"datum: free network, {a.free.defect} inner constraints over {points}{scale}"


def _listed(names: list[str]) -> str:
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return ", ".join(names[:_NAMED]) + more
