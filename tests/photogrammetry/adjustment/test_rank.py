"""Rank defects: size, cause and remedy in words."""

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from photogrammetry.adjustment.equations.problem import Problem, build_problem
from photogrammetry.adjustment.equations.unknowns import State, state_of
from photogrammetry.adjustment.solution.adjustment import adjust_once
from photogrammetry.adjustment.solution.rank import check_rank
from photogrammetry.geometry.camera_model import INTERIOR
from photogrammetry.network.diagnosis import Defect, DefectKind, NotSolvableError
from photogrammetry.network.model import Datum, Image, Network, Point, Role
from rig.images.viewing import look_at
from tests.photogrammetry.dense import analytic_jacobian
from tests.photogrammetry.synthetic import FREE, camera, hill, lab_frame, observed, rods

_LAB = lab_frame(5, points=20).network


def _keeping(network: Network, keep: Callable[[int, int], bool]) -> Network:
    """The network with the observations (image, point) for which `keep` is true."""
    o = network.observations
    left = np.array([keep(int(i), int(p)) for i, p in zip(o.image, o.point, strict=True)])
    parts = {name: getattr(o, name)[left] for name in ("image", "point", "xy", "sigma", "group")}
    return replace(network, observations=replace(o, **parts))


def _defects(network: Network) -> tuple[Defect, ...]:
    with pytest.raises(NotSolvableError) as caught:
        adjust_once(network)
    return caught.value.defects


def _only(network: Network, kind: DefectKind, size: int) -> Defect:
    (defect,) = _defects(network)
    assert (defect.kind, defect.defect) == (kind, size)
    return defect


def test_no_datum() -> None:
    defect = _only(replace(_LAB, datum=Datum()), DefectKind.DATUM, 7)
    assert "position (3), rotation (3), scale" in defect.message


def test_two_control_points_leave_a_rotation_free() -> None:
    network = hill(1).network
    points = tuple(replace(p, role=Role.TIE, sigma=None) if i > 1 else p for i, p in enumerate(network.points))
    defect = _only(replace(network, points=points), DefectKind.DATUM, 1)
    assert "rotation" in defect.message


def test_rods_without_an_origin_leave_the_position_free() -> None:
    network = rods(1).network
    points = (replace(network.points[0], role=Role.TIE), *network.points[1:])
    assert "position (3)" in _only(replace(network, points=points), DefectKind.DATUM, 3).message


def test_datum_points_that_do_not_fix_the_datum() -> None:
    defect = _only(replace(_LAB, datum=replace(FREE, points=(0, 1))), DefectKind.DATUM, 1)
    assert defect.points == ("F1", "F2")


def test_points_with_one_ray_and_without_are_told_apart() -> None:
    first = {3: 0, 7: 1}  # point: the only image that sees it
    network = _keeping(_LAB, lambda i, p: p != 11 and first.get(p, i) == i)
    none, one = _defects(network)
    assert (none.kind, none.defect, none.points) == (DefectKind.POINTS, 3, ("F12",))
    assert (one.kind, one.defect, one.points) == (DefectKind.POINTS, 2, ("F4", "F8"))
    assert "one ray" in one.message
    assert "without observations" in none.message


def test_several_causes_add_up() -> None:
    network = replace(_keeping(_LAB, lambda i, p: p != 11 or i == 0), datum=Datum())
    assert sorted((d.kind.value, d.defect) for d in _defects(network)) == [("datum", 7), ("points", 1)]


def test_an_image_without_observations_and_one_with_two() -> None:
    nothing = _only(_keeping(_LAB, lambda i, _p: i != 4), DefectKind.IMAGES, 6)
    assert nothing.images == ("lab-05",)
    few = _only(_keeping(_LAB, lambda i, p: i != 4 or p in (2, 3)), DefectKind.IMAGES, 2)
    assert few.images == ("lab-05",)


def test_a_camera_without_observations() -> None:
    cameras = (*_LAB.cameras, camera("K9", 1000.0, ("c", "x0")))
    defect = _only(replace(_LAB, cameras=cameras), DefectKind.PARAMETERS, 2)
    assert "K9" in defect.message
    assert "c, x0" in defect.message


def test_two_parts_that_nothing_ties_together() -> None:
    network = replace(_LAB, cameras=tuple(replace(c, estimate=()) for c in _LAB.cameras))
    network = _keeping(network, lambda i, p: (i < 6) == (p < 12))
    (defect,) = _defects(network)
    assert (defect.kind, defect.defect, defect.images) == (DefectKind.IMAGES, 7, ("lab-07", "lab-08", "lab-09"))
    assert "2 parts" in defect.message


def _broken(seed: int) -> Network:
    """One of the paper's networks with observations, control or constraints taken away at random."""
    rng = np.random.default_rng(seed)
    network = (_LAB, hill(1).network, rods(1).network)[seed % 3]
    o = network.observations
    keep = np.ones(len(o.image), dtype=bool)
    for kind in rng.integers(0, 5, rng.integers(0, 4)):
        match kind:
            case 0:
                keep &= ~((o.point == rng.integers(len(network.points))) & (o.image != rng.integers(3)))
            case 1:
                of_one = rng.permutation(np.flatnonzero(o.image == rng.integers(len(network.images))))
                keep[of_one[rng.integers(0, 5) :]] = False
            case 2:
                keep &= rng.random(len(keep)) < 0.4
            case 3:
                points = (replace(p, role=Role.TIE, sigma=None) if rng.random() < 0.8 else p for p in network.points)
                network = replace(network, points=tuple(points))
            case _:
                network = replace(network, distances=(), differences=network.differences[: rng.integers(0, 3)])
    parts = {name: getattr(o, name)[keep] for name in ("image", "point", "xy", "sigma", "group")}
    return replace(network, observations=replace(o, **parts), datum=Datum())


@pytest.mark.parametrize("seed", range(45))
def test_defects_add_up_to_the_rank_defect_of_the_dense_system(seed: int) -> None:
    network = _broken(seed)
    problem, state = build_problem(network), state_of(network)
    jacobian = analytic_jacobian(problem, problem.equations(state))
    length = np.linalg.norm(jacobian, axis=0)
    sizes = np.linalg.svd(jacobian / np.where(length > 0.0, length, 1.0), compute_uv=False)
    defect = jacobian.shape[1] - int(np.sum(sizes > 3e-7))
    entries = _entries(problem, state)
    assert sum(entry.defect for entry in entries) == defect
    assert all(entry.message and entry.defect > 0 for entry in entries)


def _entries(problem: Problem, state: State) -> tuple[Defect, ...]:
    try:
        check_rank(problem, state)
    except NotSolvableError as error:
        return error.defects
    return ()


def test_principal_distance_from_level_images_of_a_plane() -> None:
    """Normal views of a flat target: c and the distance cannot be separated; the rank analysis finds it."""
    rng = np.random.default_rng(4)
    xyz = np.column_stack([rng.uniform(-1, 1, (12, 2)), np.zeros(12)])
    back = np.eye(3)  # looks along -Z, down onto the plane
    images = tuple(Image(f"i{k}", 0, np.array([0.2 * k, 0.1 * k, 5.0]), back) for k in range(3))
    network = Network(
        (camera("K", 1000.0, ("c",)),),
        images,
        tuple(Point(f"P{k}", Role.FIXED, x) for k, x in enumerate(xyz)),
        _LAB.observations,
    )
    defect = _only(observed(network), DefectKind.PARAMETERS, 1)
    assert "c of K" in defect.message


def test_affinity_and_shear_with_free_poses_are_told_apart_by_roll() -> None:
    """In level images of a plane c1 acts as a scale along x; with rolled images it is determined."""
    rng = np.random.default_rng(4)
    xyz = np.column_stack([rng.uniform(-1, 1, (12, 2)), rng.uniform(-0.3, 0.3, 12)])
    places = [np.array([1.5, -2.0, 4.0]), np.array([-1.5, -2.0, 4.0]), np.array([0.0, 2.0, 4.5])]
    images = tuple(Image(f"i{k}", 0, place, look_at(place, np.zeros(3), -90.0 * k)) for k, place in enumerate(places))
    network = Network(
        (camera("K", 1000.0, INTERIOR),),
        images,
        tuple(Point(f"P{k}", Role.FIXED, x) for k, x in enumerate(xyz)),
        _LAB.observations,
    )
    adjustment = adjust_once(observed(network))
    assert adjustment.redundancy == 2 * len(adjustment.problem.image) - 18 - 10
    assert np.all(np.isfinite(adjustment.sigmas(adjustment.problem.unknowns.camera)))


def _with_sigma(network: Network, sigma: float) -> Network:
    o = network.observations
    return replace(network, observations=replace(o, sigma=np.full_like(o.sigma, sigma)))


def test_sigmas_out_of_all_proportion_are_no_missing_datum() -> None:
    network = hill(1).network
    (defect,) = _defects(_with_sigma(network, 1e-9))
    assert re.match(r"the sigmas lie \d+ orders of magnitude apart", defect.message)
    points = tuple(replace(p, sigma=np.full(3, 1e-9)) if p.role is Role.CONTROL else p for p in network.points)
    accurate = adjust_once(replace(network, points=points))
    assert np.abs(accurate.state.position - hill(1).truth.position).max() < 0.3
    alone = replace(network, points=tuple(replace(p, role=Role.TIE, sigma=None) for p in network.points))
    (defect,) = _defects(_with_sigma(alone, 1e-9))
    assert defect.kind is DefectKind.DATUM
