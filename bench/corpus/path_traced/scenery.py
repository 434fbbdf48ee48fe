"""What stands still in the path-traced pictures: snow, take-off table, forest, balls on posts."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from bench.corpus.path_traced.meshes import Mesh, arc, box, disc, ellipsoid, grid, loft
from rig.arrays import Floats
from simrig.world.projection import Projection
from simrig.world.scenario import Scenario

_STEP_M: Final = 1.5
_TABLE_END_M: Final = -45.0
_BELOW_M: Final = 0.3  # of a line of sight; the snow must not be nearer
_SLOPE: Final = 0.5  # of the snow beside a line of sight
_POST_M: Final = 0.015
_TREES: Final = 500
_FOREST_M: Final = (22.0, 70.0)  # beside the hill
_SHIELDED: Final = 0.85  # share of the balls with a dark shield behind them
_SHIELD: Final = (2.4, 2.2)  # radius and half height of a shield in radii of its ball

Placed = tuple[Mesh, tuple[str, ...], list[Floats]]  #: a mesh, its materials, and the matrices (4, 4) of its places


class Scenery:
    """The hill of a scenario.

    Args:
        scenario: the scenario.
        cameras: its cameras, none of which the snow may block.
        path: where the jumper is, m, shape (n, 3).
        rng: decides what the scenario leaves open.
    """

    def __init__(self, scenario: Scenario, cameras: list[Projection], path: Floats, rng: np.random.Generator) -> None:
        self._scenario, self._cameras, self._rng = scenario, cameras, rng
        self._balls = [ball for ball in scenario.balls if not ball.gone]
        sought = [*[np.array(ball.X) for ball in self._balls], *path]
        self._lines = [(camera.X0, place) for camera in cameras for place in sought]

    def snow(self, x: Floats, y: Floats) -> Floats:
        """Height of the snow, m: that of the hill, dug away where it would hide the scene from a camera."""
        height = self._scenario.hill.snow(x, y)
        places = np.stack((x, y), axis=-1)
        for start, end in self._lines:
            along = (end - start)[:2]
            share = np.clip((places - start[:2]) @ along / (along @ along), 0, 1)
            off = np.linalg.norm(places - start[:2] - share[..., None] * along, axis=-1)
            line = start[2] + share * (end - start)[2]
            height = np.minimum(height, line - _BELOW_M + _SLOPE * np.maximum(0.0, off - _STEP_M))
        return height

    def placed(self) -> dict[str, Placed]:
        """All that stands still, by name."""
        return {"snow": self._ground(), **self._table(), "tree": self._forest(), **self._marks()}

    def _ground(self) -> Placed:
        x = np.unique(np.concatenate((np.arange(-60, 140, 4.0), np.arange(-12, 45, _STEP_M))))
        y = np.unique(np.concatenate((np.arange(-100, 100.1, 4.0), np.arange(-30, 30, _STEP_M))))
        X, Y = np.meshgrid(x, y, indexing="ij")  # noqa: N806
        rough = self._rng.normal(0, 0.05, X.shape) * (np.abs(Y) > self._scenario.hill.knoll_width_m / 2)
        return grid(x, y, self.snow(X, Y) + rough), ("snow",), [np.eye(4)]

    def _table(self) -> dict[str, Placed]:
        """The take-off table with its two tracks."""
        half, hill = self._scenario.hill.table_width_m / 2, self._scenario.hill
        beams = {
            "table": (self._beam(-half, half, -0.02, hill.table_height_m + 8), "boards"),
            **{f"track {y}": (self._beam(y - 0.06, y + 0.06, -0.01, 0.015), "ice") for y in (-0.17, 0.17)},
        }
        return {name: (beam, (of,), [np.eye(4)]) for name, (beam, of) in beams.items()}

    def _beam(self, right: float, left: float, above: float, thick: float) -> Mesh:
        """A beam along the table from its edge on, its top so much above the table's surface; m."""
        body = box((_TABLE_END_M, right, 0), (0, left, 1))
        corners = body.corners.copy()
        corners[:, 2] = self._scenario.hill.table(corners[:, 0]) + np.where(corners[:, 2] > 0, above, above - thick)
        return Mesh(corners, body.faces, smooth=False)

    def _forest(self) -> Placed:
        """Spruces on both sides, behind the cameras where there are some."""
        spruce = loft(
            [(0, 0.15, 0.15), (1.0, 0.16, 0.16), (1.01, 2.2, 2.2), (5, 1.2, 1.2), (5.1, 1.6, 1.6), (11, 0.05, 0.05)]
        )
        near = {sign: max([0.0, *(c.X0[1] * sign + 8 for c in self._cameras)]) for sign in (-1, 1)}
        places = []
        for x, away, tall, sign in zip(
            self._rng.uniform(-55, 130, _TREES),
            self._rng.uniform(*_FOREST_M, _TREES),
            self._rng.uniform(0.7, 1.6, _TREES),
            self._rng.choice((-1, 1), _TREES),
            strict=True,
        ):
            y = sign * max(away, near[sign] + away / 4)
            matrix = np.diag((tall, tall, tall, 1.0))
            matrix[:3, 3] = x, y, float(self.snow(np.array(x), np.array(y))) - 0.3
            if all(np.hypot(*(matrix[:2, 3] - camera.X0[:2])) > 8 for camera in self._cameras):
                places.append(matrix)
        return spruce, ("needles",), places

    def _marks(self) -> dict[str, Placed]:
        """The balls with their posts, shields, and the snow before them."""
        radius = self._scenario.ball_radius_m
        where = np.array([ball.X for ball in self._balls])
        shields, mounds, posts = [], [], []
        for ball, place in zip(self._balls, where, strict=True):
            away = -towards(self._cameras, place) * (1, 1, 0)
            away /= np.linalg.norm(away)
            foot = float(self.snow(place[0], place[1])) - 0.5
            post = np.diag((1.0, 1.0, place[2] - foot, 1.0))
            post[:3, 3] = place - (0, 0, place[2] - foot)
            posts.append(post)
            if self._rng.random() < _SHIELDED:
                shield = np.eye(4)
                shield[:3] = np.stack((np.cross((0, 0, 1), away), (0, 0, 1), away, place), axis=1)
                shields.append(shield)
            if ball.covered:
                mounds.append(_at(place + radius * (2 * ball.covered - 1) * np.array((0.0, 0.0, 1.0))))
        wide, high = (of * radius for of in _SHIELD)
        return {
            "ball": (ellipsoid(radius, radius, radius, rings=33), ("ball",), [_at(place) for place in where]),
            "post": (loft([(0, _POST_M, _POST_M), (1, _POST_M, _POST_M)]), ("post",), posts),
            "shield": (arc(wide, high), ("shield",), shields),
            "mound": (_under(disc(1.6 * radius, 4 * radius), 2 * radius), ("snow",), mounds),
        }


def towards(cameras: Sequence[Projection], place: Floats) -> Floats:
    """Mean direction to the cameras on that side of the hill where most of them are, unit, shape (3,)."""
    side = 1.0 if sum(np.sign(camera.X0[1]) for camera in cameras) > 0 else -1.0
    ways = [camera.X0 - place for camera in cameras if np.sign(camera.X0[1]) == side]
    mean = np.mean([way / np.linalg.norm(way) for way in ways], axis=0)
    return np.asarray(mean / np.linalg.norm(mean))


def _at(place: Floats) -> Floats:
    """The matrix (4, 4) that puts a thing there."""
    matrix = np.eye(4)
    matrix[:3, 3] = place
    return matrix


def _under(mesh: Mesh, depth: float) -> Mesh:
    """The mesh, so much lower."""
    return Mesh(mesh.corners - (0, 0, depth), mesh.faces, mesh.smooth)
