"""Sections with the whole interior orientation in use, the poses with their rotations, and the points."""

from collections.abc import Iterator

import numpy as np

from photogrammetry.adjustment.equations.relations import Kind
from photogrammetry.adjustment.run import Outcome
from photogrammetry.adjustment.solution.adjustment import Adjustment
from photogrammetry.geometry.camera_model import INTERIOR
from photogrammetry.geometry.rotation import omega_phi_kappa, omega_phi_kappa_jacobian
from photogrammetry.network.model import AXES, Role
from photogrammetry.reports.document import Table
from photogrammetry.reports.record.digits import with_sigma
from photogrammetry.reports.record.strength import intersection_angles
from rig.arrays import Floats

_ANGLES = ("omega", "phi", "kappa")
_MATRIX_DECIMALS = 9  # of a rotation that is held: rounding moves a point at 100 m by less than a micrometre


def interior_parts(outcome: Outcome) -> tuple[str | Table, ...]:
    """All parameters of each camera: estimated, observed or held; with the interval where the sigma does not hold."""
    a, rows = outcome.adjustment, list[tuple[str, ...]]()
    intervals = {(one.camera, one.parameter.name): f", 95 % {one.ends}" for one in outcome.intervals}
    for i, camera in enumerate(a.network.cameras):
        estimated = {parameter.name: parameter for parameter in a.parameters(i)[0]}
        for name, value in zip(INTERIOR, a.state.interior[i].tolist(), strict=True):
            found = estimated.get(name)
            shown, sigma = with_sigma(value, 0.0 if found is None else found.sigma)
            how = "held" if found is None else f"estimated{intervals.get((camera.name, name), '')}"
            if found is not None and name in camera.sigma:
                how += f", observed {camera.interior[INTERIOR.index(name)]:.6g} ± {camera.sigma[name]:.3g}"
            significant = "" if found is None or name == "c" else "no" if found.insignificant else "yes"
            rows.append((f"{camera.name} {name}", shown, sigma, how, significant))
        rows.append((f"{camera.name} r0", f"{camera.balance:.10g}", "-", "held", ""))
    sides = ", ".join(
        f"{camera.name} {camera.distortion.value}"
        + ("" if camera.size is None else f", {camera.size[0]} x {camera.size[1]} px")
        for camera in a.network.cameras
    )
    return (
        f"Lengths in {a.network.image_unit}, metric frame (x right, y up, origin at the image centre).",
        f"The distortion acts on the side: {sides}.",
        Table(("parameter", "value", "sigma", "how", "significant"), tuple(rows)),
    )


def pose_parts(a: Adjustment) -> tuple[str | Table, ...]:
    """Projection centres, angles omega, phi, kappa, and rotation matrices, all with sigmas."""
    images, unit = a.network.images, a.length_unit or "length units"
    columns = a.problem.unknowns.pose
    sigma, about = a.sigmas(columns), np.degrees(a.sigmas(columns)[:, 3:])
    places, angles, matrices = [], [], []
    of_angles = _angle_sigmas(a)
    for i, image in enumerate(images):
        places.append((image.name, a.network.cameras[image.camera].name, *_row(a.state.position[i], sigma[i, :3])))
        turned = _row(np.degrees(omega_phi_kappa(a.state.rotation[i])), np.degrees(of_angles[i]))
        angles.append((image.name, *turned, *(with_sigma(0.0, s)[1] for s in about[i])))
        matrices += list(_matrix_rows(image.name, a.state.rotation[i], sigma[i, 3:]))
    return (
        f"Projection centres, {unit}:",
        Table(("image", "camera", *_headed(("X0", "Y0", "Z0"))), tuple(places)),
        "Degrees: R = R_X(omega) R_Y(phi) R_Z(kappa); sigma 1, 2, 3 are of turns about the camera's own axes:",
        Table(("image", *_headed(_ANGLES), "sigma 1", "sigma 2", "sigma 3"), tuple(angles)),
        "Rotations R; the columns are the camera's axes in the object system:",
        Table(("image", "axis", "r1", "r2", "r3"), tuple(matrices)),
    )


def _angle_sigmas(a: Adjustment) -> Floats:
    """Standard deviations (images, 3), rad, of omega, phi, kappa; not finite where phi is a right angle."""
    jacobian = omega_phi_kappa_jacobian(omega_phi_kappa(a.state.rotation))
    with np.errstate(invalid="ignore"):
        covariance = jacobian @ a.covariance(a.problem.unknowns.pose[:, 3:]) @ np.swapaxes(jacobian, 1, 2)
        sigmas: Floats = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    return sigmas


def _matrix_rows(name: str, rotation: Floats, sigma: Floats) -> Iterator[tuple[str, ...]]:
    known = float(sigma[sigma > 0.0].min(initial=np.inf))
    for axis, row in zip(AXES, rotation.tolist(), strict=True):
        numbers = [with_sigma(x, known)[0] if np.isfinite(known) else f"{x:.{_MATRIX_DECIMALS}f}" for x in row]
        yield (name, axis, *numbers)


def point_parts(a: Adjustment) -> tuple[str | Table, ...]:
    """Coordinates with sigmas, number of rays, and the intersection angle of each point; their means over roles."""
    sigma = a.sigmas(a.problem.unknowns.point)
    count = np.bincount(a.problem.point, minlength=len(a.network.points))
    angles = np.degrees(intersection_angles(a))
    rows = [
        (
            point.name,
            point.role.value,
            str(count[i]),
            *_row(a.state.xyz[i], sigma[i]),
            f"{angles[i]:.1f}" if np.isfinite(angles[i]) else "-",
        )
        for i, point in enumerate(a.network.points)
    ]
    return (
        Table(("point", "role", "rays", *_headed(AXES), "angle"), tuple(rows)),
        "angle: the nearest to a right angle at which two rays of the point meet, degrees",
    )


def mean_parts(a: Adjustment) -> tuple[str | Table, ...]:
    """Root mean squares of X, Y, Z: sigmas by role, residuals of the survey, differences of the check points."""
    of_points, of_places = a.sigmas(a.problem.unknowns.point), a.sigmas(a.problem.unknowns.pose[:, :3])
    rows: list[tuple[str, ...]] = []
    for role in (Role.TIE, Role.CONTROL, Role.CHECK):
        chosen = [i for i, point in enumerate(a.network.points) if point.role is role]
        rows += _mean(f"sigma of {role.value} points", of_points[chosen])
    rows += _mean("sigma of projection centres", of_places)
    survey = a.relation_residuals()[a.problem.relations.rows(Kind.CONTROL)].reshape(-1, 3)
    rows += _mean("residuals of control points", survey)
    rows += _mean("check points, adjusted - given", check_differences(a))
    unit = a.length_unit or "length units"
    return (f"Root mean squares, {unit}:", Table(("of", "count", *AXES, "all"), tuple(rows))) if rows else ()


def check_differences(a: Adjustment) -> Floats:
    """Adjusted - given coordinates of the check points: (k, 3)."""
    found = [
        a.state.xyz[i] - point.xyz
        for i, point in enumerate(a.network.points)
        if point.role is Role.CHECK and point.xyz is not None
    ]
    return np.array(found).reshape(-1, 3)


def _mean(name: str, values: Floats) -> list[tuple[str, ...]]:
    if not len(values):
        return []
    squares = np.mean(values**2, axis=0)
    return [(name, str(len(values)), *(f"{x:.3g}" for x in np.sqrt(squares)), f"{np.sqrt(squares.mean()):.3g}")]


def _row(values: Floats, sigmas: Floats) -> tuple[str, ...]:
    """Value and sigma of each, side by side."""
    return tuple(text for v, s in zip(values, sigmas, strict=True) for text in with_sigma(float(v), float(s)))


def _headed(names: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(head for name in names for head in (name, f"sigma {name}"))
