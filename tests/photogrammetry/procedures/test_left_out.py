"""A tie point without a place, or an image that nothing orients, is named; the others are oriented without it."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from photogrammetry.geometry.ideal_camera import IdealCamera
from photogrammetry.network.diagnosis import NotSolvableError
from photogrammetry.network.file_writer import write_network
from photogrammetry.network.model import ImageObservations, Network, Role
from photogrammetry.network.selection import only_observations
from photogrammetry.procedures.orientation import Orientation, orient
from rig.arrays import Floats
from svev.cli import main
from tests.photogrammetry.synthetic import SIGMA_PX, Synthetic, hill
from tests.support.repeats import repeats

_TIE = 20  # T6
_MIDDLE = np.array([10.0, 0.0, -2.0])


def _bare(network: Network) -> Network:
    """Neither poses nor tie points are known."""
    images = tuple(replace(image, position=None, rotation=None) for image in network.images)
    points = tuple(replace(p, xyz=None) if p.role is Role.TIE else p for p in network.points)
    return replace(network, images=images, points=points)


def _with_tie(case: Synthetic, places: dict[int, Floats], rng: np.random.Generator) -> Network:
    """The network whose last tie point is, in each of some images, where that image would show another place."""
    network = _bare(case.network)
    o = network.observations
    keep, count = o.point != _TIE, len(places)
    xy = []
    for i, place in places.items():
        c = network.cameras[network.images[i].camera].interior[0]
        xy.append(IdealCamera(c, case.truth.position[i], case.truth.rotation[i]).project(place))
    noisy = np.array(xy) + rng.normal(0.0, SIGMA_PX, (count, 2))
    more = ImageObservations(
        np.array(list(places), dtype=np.intp),
        np.full(count, _TIE, dtype=np.intp),
        np.concatenate((o.xy[keep], noisy)),
        np.concatenate((o.sigma[keep], np.full((count, 2), SIGMA_PX))),
        np.zeros(keep.sum() + count, dtype=np.intp),
    )
    image, point = np.concatenate((o.image[keep], more.image)), np.concatenate((o.point[keep], more.point))
    return replace(network, observations=replace(more, image=image, point=point))


def _off(case: Synthetic, orientation: Orientation) -> float:
    """Largest error of a projection centre in sigmas."""
    a = orientation.outcome.adjustment
    sigma = a.sigmas(a.problem.unknowns.pose[:, :3])
    return float(np.abs((a.state.position - case.truth.position[: len(sigma)]) / sigma).max())


def _told(orientation: Orientation) -> list[str]:
    """Everything that is said beyond the alternative."""
    found = [finding.message for stage in orientation.stages for finding in stage.findings]
    return [*orientation.notes[1:], *found]


def _far(case: Synthetic, distance: float) -> Floats:
    """A place far behind the hill, or behind the cameras."""
    from_here = case.truth.position.mean(axis=0)
    return np.asarray(from_here + distance * (_MIDDLE - from_here) / np.linalg.norm(_MIDDLE - from_here))


@pytest.mark.parametrize("images", repeats([((0, 1),), ((0, 1, 2),)]))
@pytest.mark.parametrize(
    ("distance", "words"),
    [(1e6, "rays parallel within their accuracy"), (-300.0, "rays (parallel|meet behind a camera)")],
    ids=["parallel", "diverging"],
)
@pytest.mark.parametrize("seed", repeats(range(1, 7)))
def test_a_tie_point_without_a_place_is_named_and_the_others_are_oriented(
    seed: int, distance: float, words: str, images: tuple[int, ...]
) -> None:
    case = hill(seed)
    network = _with_tie(case, dict.fromkeys(images, _far(case, distance)), np.random.default_rng(seed))
    orientation = orient(network)
    assert _off(case, orientation) < 5.0
    told = [line for line in _told(orientation) if "T6" in line]
    assert told or "T6" in {point.name for point in orientation.outcome.adjustment.network.points}
    assert [line for line in _told(orientation) if "T6" not in line] == []
    if told:
        assert told[0].startswith("point T6 is left out: in hill-1, hill-2") or "T6 in image" in told[0]


@pytest.mark.parametrize("images", [(0, 1), (1, 2), (0, 1, 2)])
@pytest.mark.parametrize("seed", repeats(range(1, 7)))
def test_a_tie_point_that_is_another_object_in_each_image_is_named(seed: int, images: tuple[int, ...]) -> None:
    case, rng = hill(seed), np.random.default_rng(seed)
    network = _with_tie(case, {i: _MIDDLE + rng.uniform(-6.0, 6.0, 3) for i in images}, rng)
    orientation = orient(network)
    assert _off(case, orientation) < 5.0
    assert _told(orientation)
    assert all("T6" in line for line in _told(orientation))


def test_plain_adjust_names_the_tie_point_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    case = hill(1)
    write_network(
        _with_tie(case, dict.fromkeys((0, 1), _far(case, -300.0)), np.random.default_rng(1)), tmp_path / "n.json"
    )
    assert main(["adjust", str(tmp_path / "n.json"), "--force", "-o", str(tmp_path / "result.json")]) == 4
    assert "tie points without a place, leave them out: T6 in hill-1, hill-2, rays" in capsys.readouterr().out


def test_a_tie_point_with_one_ray_is_named() -> None:
    case = hill(1)
    orientation = orient(_with_tie(case, {1: _MIDDLE}, np.random.default_rng(1)))
    assert _told(orientation) == [
        "point T6 is left out: in hill-2, fewer than two rays: measure the point in another image"
    ]


@pytest.mark.parametrize("points", [0, 2])
def test_an_image_that_nothing_orients_is_named_and_the_others_are_oriented(
    points: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    case = hill(1)
    network = _bare(case.network)
    o = network.observations
    network = only_observations(network, (o.image != 2) | (o.point < points))
    orientation = orient(network)
    assert [image.name for image in orientation.outcome.adjustment.network.images] == ["hill-1", "hill-2"]
    assert _off(case, orientation) < 5.0
    (told,) = _told(orientation)
    assert told.startswith("not oriented: image hill-3")
    write_network(network, tmp_path / "hill.json")
    assert main(["orient", str(tmp_path / "hill.json"), "--force", "-o", str(tmp_path / "poses.json")]) == 0
    assert told in capsys.readouterr().out
    assert list(json.loads((tmp_path / "poses.json").read_text())["images"]) == ["hill-1", "hill-2"]


def test_where_no_image_is_left_that_is_the_failure() -> None:
    network = _bare(hill(1).network)
    with pytest.raises(NotSolvableError, match="images hill-1, hill-2, hill-3 without observations"):
        orient(only_observations(network, np.zeros(len(network.observations.image), dtype=bool)))
