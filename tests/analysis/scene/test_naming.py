"""Names from geometry alone: true ones among wrong spots; refused where chance could have made them."""

from dataclasses import dataclass

import numpy as np
import pytest

from analysis.scene.hypotheses import Approximate
from analysis.scene.naming import NotNamedError, Spots, name_balls
from analysis.scene.single_pose import SinglePose, predict
from analysis.scene.survey import KnownPoints
from analysis.scene.three_points import poses_from_three_points
from photogrammetry.geometry.ideal_camera import unit_rays
from photogrammetry.geometry.rotation import rotation_from_vector
from photogrammetry.network.model import Camera
from rig.arrays import Floats
from rig.images.viewing import look_at
from tests.support.repeats import repeats

SIZE = (640, 480)
SIGMA = 0.012


@dataclass(frozen=True, slots=True)
class Sight:
    """A camera, its true pose, surveyed balls, and what it saw; `names` of the spots, -1: none."""

    camera: Camera
    pose: SinglePose
    known: KnownPoints
    spots: Spots
    names: Floats


def _sight(
    seed: int,
    balls: int = 14,
    wrong: int = 10,
    hidden: int = 0,
    flat: bool = False,
    a1: float = 0.0,
    roll: float = 0.0,
    c: float = 1250.0,
) -> Sight:
    """Balls around a hill of 20 m as a camera 40 m away sees them, and spots that are none."""
    rng = np.random.default_rng(seed)
    xyz = rng.uniform((0, -8, -7), (20, 9, 4), (balls, 3))
    if flat:
        xyz[:, 2] = -0.2 * xyz[:, 0]
    position = np.array((rng.uniform(-20, 40), -rng.uniform(30, 40), rng.uniform(-9, 9)))
    rotation = look_at(tuple(position), (10.0, 0.0, -2.5), roll)
    camera = Camera("K1", np.array([c, 4.0, -3.0, a1, *[0.0] * 6]), size=SIZE)
    pose = SinglePose(position, rotation, np.zeros((6, 6)))
    xy, _, _ = predict(camera.lens(), pose, xyz, np.zeros((balls, 3, 3)))
    inside = np.flatnonzero((np.abs(xy) < np.array(SIZE) / 2 - 3).all(axis=1))[hidden:]
    spots = np.concatenate((xy[inside] + rng.normal(0, 0.03, (len(inside), 2)), _random(rng, wrong)))
    order = rng.permutation(len(spots))
    names = np.concatenate((inside, np.full(wrong, -1)))[order]
    known = KnownPoints(
        tuple(f"B{i}" for i in range(balls)),
        xyz + rng.normal(0, SIGMA, xyz.shape),
        np.tile(np.eye(3) * SIGMA**2, (balls, 1, 1)),
    )
    return Sight(camera, pose, known, Spots(spots[order], np.tile(np.eye(2) * 9e-4, (len(spots), 1, 1))), names)


def _random(rng: np.random.Generator, count: int) -> Floats:
    return rng.uniform(-0.5, 0.5, (count, 2)) * SIZE


def _check(sight: Sight, approximate: Approximate | None = None) -> None:
    """All names are right, nearly all balls have one, and the pose is within its sigmas."""
    naming = name_balls(sight.camera, sight.spots, sight.known, approximate)
    assert (sight.names[naming.spots] == naming.points).all()
    assert len(naming.points) >= (sight.names >= 0).sum() - 1
    off = naming.pose.position - sight.pose.position
    assert off @ np.linalg.inv(naming.pose.covariance[:3, :3]) @ off < 16.3  # 99.9 %


@pytest.mark.parametrize("seed", range(6))
def test_balls_are_named_without_any_start_value(seed: int) -> None:
    _check(_sight(seed))


@pytest.mark.parametrize("seed", repeats(range(8)))
def test_balls_are_named_in_an_image_of_a_small_part_of_the_hill(seed: int) -> None:
    """Hardly any triple of surveyed balls lies in it."""
    seeds = (seed for seed in range(100 * seed, 100 * seed + 100))
    sights = (_sight(seed, balls=20, wrong=2, c=3200.0) for seed in seeds)
    _check(next(sight for sight in sights if (sight.names >= 0).sum() == 6))


@pytest.mark.parametrize("roll", [90.0, 180.0, -37.0])
def test_a_camera_may_lie_on_its_side_or_hang(roll: float) -> None:
    _check(_sight(31, roll=roll))


def test_forty_wrong_spots_are_thrown_out() -> None:
    _check(_sight(32, balls=15, wrong=40))


def test_hidden_balls_are_not_missed() -> None:
    _check(_sight(33, balls=15, wrong=8, hidden=5))


def test_balls_in_a_plane_are_enough() -> None:
    _check(_sight(34, flat=True))


def test_a_lens_that_distorts_is_no_hindrance() -> None:
    _check(_sight(35, a1=-2e-7))


def test_an_approximate_pose_is_used() -> None:
    sight = _sight(36, wrong=35)
    near = Approximate(
        sight.pose.position + np.array((2.0, -1.5, 1.0)),
        sight.pose.rotation @ rotation_from_vector(np.array([0.05, 0.04, 0.03])),
        5.0,
        0.15,
    )
    _check(sight, near)


def test_five_balls_near_an_approximate_pose_are_enough() -> None:
    sight = _sight(37, balls=5, wrong=4)
    near = Approximate(sight.pose.position + np.array((0.5, -0.5, 0.5)), sight.pose.rotation, 2.0, 0.05)
    _check(sight, near)


def test_an_approximate_pose_that_is_elsewhere_names_nothing() -> None:
    sight = _sight(38)
    far = Approximate(sight.pose.position + np.array((25.0, 0.0, 0.0)), sight.pose.rotation, 3.0, 0.1)
    with pytest.raises(NotNamedError):
        name_balls(sight.camera, sight.spots, sight.known, far)


# Each compares 10^5 poses with chance; one in 10^3 draws may be believed.
@pytest.mark.parametrize("seed", repeats(range(3)))
def test_spots_that_are_no_balls_are_never_named(seed: int) -> None:
    sight = _sight(seed)
    rng = np.random.default_rng(100 + seed)
    spots = Spots(_random(rng, 22), np.tile(np.eye(2) * 9e-4, (22, 1, 1)))
    with pytest.raises(NotNamedError, match="do not fit the 14 surveyed balls"):
        name_balls(sight.camera, spots, sight.known)


def test_four_balls_without_a_start_value_could_be_chance() -> None:
    sight = _sight(41, balls=12, wrong=6)
    right = np.flatnonzero(sight.names >= 0)[4:]
    chosen = np.setdiff1d(np.arange(len(sight.names)), right)
    with pytest.raises(NotNamedError, match="do not fit the 12 surveyed balls"):
        name_balls(sight.camera, Spots(sight.spots.xy[chosen], sight.spots.covariance[chosen]), sight.known)


def test_balls_that_look_alike_from_two_sides_are_ambiguous() -> None:
    """A survey that is its own mirror image: turned by half a turn about a vertical axis it is the same."""
    sight = _sight(42, balls=11, wrong=3)
    turned = (sight.known.xyz - (10.0, 0.0, 0.0)) * (-1.0, -1.0, 1.0) + (10.0, 0.0, 0.0)
    both = np.concatenate((sight.known.xyz, turned))
    known = KnownPoints(tuple(f"B{i}" for i in range(22)), both, np.tile(np.eye(3) * SIGMA**2, (22, 1, 1)))
    with pytest.raises(NotNamedError, match=r"in two ways .* ambiguous; show more balls"):
        name_balls(sight.camera, sight.spots, known)


def test_too_few_spots_and_balls_on_a_line_are_refused() -> None:
    sight = _sight(43)
    few = Spots(sight.spots.xy[:3], sight.spots.covariance[:3])
    with pytest.raises(NotNamedError, match="3 balls found, at least 4 are needed"):
        name_balls(sight.camera, few, sight.known)
    line = np.linspace(0, 20, 14)[:, None] * (1.0, 0.1, -0.2)
    with pytest.raises(NotNamedError, match="lie on a line: survey one beside it"):
        name_balls(sight.camera, sight.spots, KnownPoints(sight.known.names, line, sight.known.covariance))


def test_three_points_give_the_true_pose_among_theirs() -> None:
    rng = np.random.default_rng(44)
    for _ in range(200):
        points = rng.uniform(-10, 10, (3, 3))
        position = np.array((0.0, -40.0, 5.0)) + rng.normal(0, 3, 3)
        rotation = look_at(tuple(position), (0.0, 0.0, 0.0), rng.uniform(-180, 180))
        k = (points - position) @ rotation
        rays = unit_rays(-1400.0 * k[:, :2] / k[:, 2:], 1400.0)
        positions, rotations, triple = poses_from_three_points(points[None], rays[None])
        assert (triple == 0).all()
        off = np.linalg.norm(positions - position, axis=1) + 10 * np.abs(rotations - rotation).max(axis=(1, 2))
        assert off.min() < 1e-4
