"""Start values from nothing: the paper's networks, principal distances wrong by a factor of two, broken networks.

Criterion: the adjustment from these start values reaches the same optimum as the adjustment from the truth.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from photogrammetry.adjustment.solution.adjustment import adjust_once
from photogrammetry.network.diagnosis import Defect, NotSolvableError
from photogrammetry.network.file import read_network
from photogrammetry.network.model import Datum, DatumType, Network, Point, Role
from photogrammetry.start_values.search import complete
from tests.photogrammetry.networks import Case, hill, laboratory, observations, rods, sheet
from tests.support.repeats import repeats

_CAMCAL = Path(__file__).parents[1] / "data" / "camcal" / "network.json"


def _from_truth(case: Case) -> Network:
    """The network with the true poses and points as start values, and the principal distances of the case."""
    images = tuple(
        replace(image, position=camera.X0, rotation=camera.R)
        for image, camera in zip(case.network.images, case.cameras, strict=True)
    )
    points = tuple(
        replace(point, xyz=xyz) if point.role is Role.TIE else point
        for point, xyz in zip(case.network.points, case.xyz, strict=True)
    )
    return replace(case.network, images=images, points=points)


def _assert_same_optimum(case: Case, factors: tuple[float, ...]) -> Network:
    start = complete(case.with_c(factors).network)
    found, expected = adjust_once(start), adjust_once(_from_truth(case))
    assert found.vtpv == pytest.approx(expected.vtpv, rel=1e-6)
    np.testing.assert_allclose(found.state.interior[:, 0], expected.state.interior[:, 0], rtol=1e-5)
    assert found.iterations < 25
    return start


@pytest.mark.parametrize(
    "factors", repeats([[(0.5, 2.0, 1.0)], [(1.0, 1.0, 1.0)], [(0.5, 0.5, 0.5)], [(2.0, 2.0, 2.0)]])
)
def test_laboratory(factors: tuple[float, ...]) -> None:
    _assert_same_optimum(laboratory(np.random.default_rng(11)), factors)


def test_laboratory_without_noise_is_exact() -> None:
    case = laboratory(np.random.default_rng(12), estimate=(), sigma=1e-3)
    case = replace(case, network=complete(case.network))
    adjusted = adjust_once(case.network)
    scale = np.linalg.norm(adjusted.state.xyz[1] - adjusted.state.xyz[0]) / np.linalg.norm(case.xyz[1] - case.xyz[0])
    for i in range(5, 55, 7):
        length = np.linalg.norm(adjusted.state.xyz[i] - adjusted.state.xyz[0]) / scale
        assert length == pytest.approx(np.linalg.norm(case.xyz[i] - case.xyz[0]), rel=1e-4)


def test_hill_by_resection_from_control() -> None:
    case = hill(np.random.default_rng(13))
    start = _assert_same_optimum(case, (1.0, 1.0, 1.0))
    for image, camera in zip(start.images, case.cameras, strict=True):
        assert image.position is not None
        assert np.linalg.norm(image.position - camera.X0) < 1.0
    assert all(point.xyz is not None for point in start.points)
    # surveyed coordinates are observations: untouched
    assert all(a.xyz is b.xyz for a, b in zip(start.points, case.network.points, strict=True) if b.role is Role.CONTROL)


@pytest.mark.parametrize("factors", repeats([[(0.5, 2.0, 1.0)], [(1.0, 1.0, 1.0)], [(2.0, 2.0, 2.0)]]))
def test_rods_give_the_object_system(factors: tuple[float, ...]) -> None:
    case = rods(np.random.default_rng(14))
    start = _assert_same_optimum(case, factors)
    adjusted = adjust_once(start)
    assert np.abs(adjusted.state.xyz - case.xyz).max() < 0.2


@pytest.mark.parametrize("factor", [0.5, 1.0, 2.0])
def test_flat_sheet_by_planar_resection(factor: float) -> None:
    _assert_same_optimum(sheet(np.random.default_rng(15)), (factor,))


@pytest.mark.parametrize("factor", repeats([0.5, 2.0]))
@pytest.mark.parametrize("control", [True, False])
def test_published_self_calibration_from_nothing(factor: float, control: bool) -> None:
    """Data set camcal without poses and points, c wrong by a factor of two: published sigma0; and as free network."""
    network = read_network(_CAMCAL)
    camera = network.cameras[0]
    camera = replace(camera, interior=camera.interior * np.array([factor, *[1.0] * 9]))
    images = tuple(replace(image, position=None, rotation=None) for image in network.images)
    network = replace(network, cameras=(camera,), images=images)
    if not control:
        points = tuple(Point(point.name, Role.TIE) for point in network.points)
        network = replace(network, points=points, datum=Datum(DatumType.INNER))
    adjusted = adjust_once(complete(network))
    assert adjusted.sigma0 is not None
    if control:
        assert adjusted.sigma0 == pytest.approx(1.6148, abs=2e-4)
    else:  # the error-free corners of the sheet were not quite so
        assert 1.3 < adjusted.sigma0 < 1.6
    assert adjusted.state.interior[0, 0] == pytest.approx(2336.808, abs=0.4)


def test_flat_sheet_without_control_by_relative_orientation() -> None:
    """A plane leaves two relative orientations of a pair; the third image decides."""
    case = sheet(np.random.default_rng(16))
    points = tuple(Point(p.name, Role.TIE) for p in case.network.points)
    camera = replace(case.network.cameras[0], estimate=())
    network = replace(case.network, points=points, cameras=(camera,))
    start = complete(network)
    position = np.array([image.position for image in start.images])
    xyz = np.array([point.xyz for point in start.points])
    scale = np.linalg.norm(case.xyz[63] - case.xyz[0]) / np.linalg.norm(xyz[63] - xyz[0])
    heights = scale * np.linalg.norm(position - xyz.mean(axis=0), axis=1)
    true = np.linalg.norm([camera.X0 - case.xyz.mean(axis=0) for camera in case.cameras], axis=1)
    np.testing.assert_allclose(heights, true, rtol=0.05)


def test_what_is_given_stays() -> None:
    case = hill(np.random.default_rng(17))
    image = replace(case.network.images[1], position=case.cameras[1].X0, rotation=case.cameras[1].R)
    network = replace(case.network, images=(case.network.images[0], image, case.network.images[2]))
    start = complete(network)
    assert start.images[1].position is image.position
    assert start.images[1].rotation is image.rotation
    full = complete(start)
    assert all(a.position is b.position for a, b in zip(start.images, full.images, strict=True))
    assert all(a.xyz is b.xyz for a, b in zip(start.points, full.points, strict=True))


def test_equal_input_gives_equal_output() -> None:
    network = laboratory(np.random.default_rng(18), estimate=()).network
    first, second = complete(network), complete(network)
    for a, b in zip(first.images, second.images, strict=True):
        np.testing.assert_array_equal(a.position, b.position)
        np.testing.assert_array_equal(a.rotation, b.rotation)


def _cut(case: Case, rows: np.ndarray) -> Network:
    """The network with some of the observations."""
    o = case.network.observations
    parts = {name: getattr(o, name)[rows] for name in ("image", "point", "xy", "sigma", "group")}
    return replace(case.network, observations=replace(o, **parts))


def _missing(network: Network) -> list[Defect]:
    """The defects that the adjustment reports of a network completed with start values and placeholders."""
    start = complete(network)
    assert all(image.position is not None for image in start.images)
    assert all(point.xyz is not None for point in start.points)
    with pytest.raises(NotSolvableError) as caught:
        adjust_once(start)
    return list(caught.value.defects)


def test_an_image_that_hangs_on_two_points_is_named() -> None:
    case = laboratory(np.random.default_rng(19), estimate=())
    o = case.network.observations
    (missing,) = _missing(_cut(case, (o.image != 4) | (o.point < 2)))
    assert missing.images == ("lab-5",)
    assert missing.message.startswith("image lab-5: 2 observed points do not determine its pose")


def test_points_with_one_ray_and_without_are_named() -> None:
    case = laboratory(np.random.default_rng(20), estimate=())
    o = case.network.observations
    rows = ((o.point != 7) | (o.image == 3)) & (o.point != 9)
    without, single = _missing(_cut(case, rows))
    assert (without.points, single.points) == (("F10",), ("F8",))
    assert without.message.startswith("point F10 without observations")
    assert single.message.startswith("point F8 with one ray only")


def test_two_blocks_without_common_points_are_named() -> None:
    case = laboratory(np.random.default_rng(21), estimate=())
    o = case.network.observations
    (missing,) = _missing(_cut(case, (o.image < 5) == (o.point < 30)))
    assert "the network falls into 2 parts that nothing ties together" in missing.message
    assert missing.images == ("lab-6", "lab-7", "lab-8", "lab-9")


def test_a_network_without_observations_only_gets_placeholders() -> None:
    case = laboratory(np.random.default_rng(22), estimate=())
    empty = replace(case.network, observations=observations(np.zeros((60, 9, 2)), 1.0, np.zeros((60, 9), bool)))
    images, points = _missing(empty)[:2]
    assert len(images.images) == 9
    assert "without observations" in images.message
    assert len(points.points) == 60
    assert points.message.startswith("points F1, F2")
    assert "52 more" in points.message


def test_a_blunder_does_not_spoil_the_start() -> None:
    case = hill(np.random.default_rng(23))
    xy = case.network.observations.xy.copy()
    row = np.flatnonzero((case.network.observations.point == 4) & (case.network.observations.image == 1))[0]
    xy[row] += (150.0, -80.0)
    network = replace(case.network, observations=replace(case.network.observations, xy=xy))
    for image, camera in zip(complete(network).images, case.cameras, strict=True):
        assert image.position is not None
        assert np.linalg.norm(image.position - camera.X0) < 2.0
