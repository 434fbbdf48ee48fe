"""Free networks: as many conditions as the datum defect, and the same invariants in every datum."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from photogrammetry.adjustment.solution.adjustment import Adjustment, adjust_once
from photogrammetry.adjustment.solution.datum import DatumError
from photogrammetry.network.model import Datum, DatumType, Difference, Distance, Network, Point, Role
from rig.arrays import Floats
from tests.photogrammetry.synthetic import FREE, lab_frame, with_state

_POINTS = 20


def _lab() -> Network:
    return lab_frame(5, points=_POINTS).network


def _with_distance() -> Network:
    network = _lab()
    a, b = network.points[0].xyz, network.points[1].xyz
    assert a is not None
    assert b is not None
    return replace(network, distances=(Distance(0, 1, float(np.linalg.norm(a - b)), 1e-4),))


def _with_vertical() -> Network:
    """Distance and two differences: the scale and two rotations are fixed."""
    network = _with_distance()
    a, b = network.points[2].xyz, network.points[3].xyz
    assert a is not None
    assert b is not None
    ties = tuple(Difference(2, 3, axis, float(b[axis] - a[axis]), 1e-4) for axis in (0, 1))
    return replace(network, differences=ties)


def _with_fixed_point() -> Network:
    network = _lab()
    return replace(network, points=(replace(network.points[0], role=Role.FIXED), *network.points[1:]))


def _with_weighted_pose() -> Network:
    network = _lab()
    image = replace(network.images[0], sigma_position=np.full(3, 0.01), sigma_angles=np.full(3, 0.001))
    return replace(network, images=(image, *network.images[1:]))


@pytest.mark.parametrize(
    ("case", "defect"),
    [(_lab, 7), (_with_distance, 6), (_with_vertical, 4), (_with_fixed_point, 4), (_with_weighted_pose, 1)],
)
def test_as_many_conditions_as_the_datum_defect(case: Callable[[], Network], defect: int) -> None:
    adjustment = adjust_once(case())
    assert adjustment.free.defect == defect
    total = adjustment.controlled.total
    assert total == pytest.approx(adjustment.redundancy, abs=1e-6)


def _invariants(adjustment: Adjustment) -> Floats:
    """Quantities that are equal in every datum: residuals, redundancy, interior orientation, ratios of distances."""
    columns = adjustment.problem.unknowns.camera
    places = adjustment.state.xyz
    ratio = np.linalg.norm(places[5] - places[6]) / np.linalg.norm(places[7] - places[8])
    return np.concatenate(
        [
            adjustment.image_residuals().ravel(),
            adjustment.controlled.image_numbers.ravel(),
            (adjustment.state.interior[:, [0, 1, 2, 3]] / (1.0, 1.0, 1.0, 1e-8)).ravel(),
            (adjustment.sigmas(columns) / (1.0, 1.0, 1.0, 1e-8)).ravel(),
            [adjustment.ratio, ratio],
        ]
    )


def _fixed_datum() -> Network:
    """Seven coordinates held with a tiny sigma relative to a free solution: a minimal datum."""
    adjusted = adjust_once(_lab())
    network = _lab()
    control = []
    for i, point in enumerate(network.points):
        if i < 2:
            control.append(Point(point.name, Role.FIXED, adjusted.state.xyz[i]))
        else:
            control.append(point)
    # the third point keeps one coordinate: across the line of the other two, where it fixes the rotation about it
    xyz = adjusted.state.xyz
    axis = int(np.argmax(np.abs(np.cross(xyz[1] - xyz[0], xyz[2] - xyz[0]))))
    tie = Difference(0, 2, axis, float(xyz[2, axis] - xyz[0, axis]), 1e-5)
    return replace(network, points=tuple(control), differences=(tie,), datum=Datum())


@pytest.mark.parametrize(
    "datum",
    [replace(FREE, points=(0, 1, 2)), replace(FREE, points=(3, 5, 7, 9, 11)), None],
    ids=["three points", "five points", "minimal"],
)
def test_invariants_are_equal_in_every_datum(datum: Datum | None) -> None:
    free = adjust_once(_lab())
    other = adjust_once(_fixed_datum() if datum is None else replace(_lab(), datum=datum))
    # both stop within 1e-6 of a sigma, and sigmas here are up to 20 px (c of K3)
    assert np.abs(_invariants(free) - _invariants(other)).max() < 1e-4


def test_inner_constraints_keep_the_centre_and_have_the_smallest_trace() -> None:
    network = _lab()
    free = adjust_once(network)
    start = np.array([point.xyz for point in network.points])
    assert np.abs(free.state.xyz.mean(axis=0) - start.mean(axis=0)).max() < 1e-10
    few = adjust_once(replace(network, datum=replace(FREE, points=(0, 1, 2))))
    columns = free.problem.unknowns.point
    assert np.sum(free.sigmas(columns) ** 2) < np.sum(few.sigmas(columns) ** 2)
    assert np.abs(few.state.xyz[:3] - start[:3]).max() < np.abs(free.state.xyz[:3] - start[:3]).max() + 0.05


def test_s_transformation_equals_the_adjustment_in_the_other_datum() -> None:
    points = np.array([1, 4, 6, 8])
    free = adjust_once(_lab())
    # from the adjusted values on: then the datum points of the other adjustment are where ours are
    there = with_state(_lab(), free.state)
    other = adjust_once(replace(there, datum=Datum(DatumType.INNER, tuple(points.tolist()))))
    sigma = np.sqrt(np.diagonal(other.cofactors))
    transformed = free.in_datum(points)
    assert np.abs((transformed.cofactors - other.cofactors) / sigma[:, None] / sigma).max() < 1e-5
    back = transformed.in_datum(np.arange(_POINTS))
    sigma = np.sqrt(np.diagonal(free.cofactors))
    assert np.abs((back.cofactors - free.cofactors) / sigma[:, None] / sigma).max() < 1e-8


def test_points_on_a_line_are_no_datum() -> None:
    with pytest.raises(DatumError):
        adjust_once(_lab()).in_datum(np.array([2, 3]))
