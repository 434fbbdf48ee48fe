"""How a thing's place appears in the images: by oriented cameras from space, or an image by itself.

An image that is not oriented tracks in its own plane: place and motion are those in the image, px.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np

from analysis.scene.camera_system import CameraSystem
from photogrammetry.intersection.point_intersection import PointState, intersect_points
from rig.arrays import Floats
from rig.errors import BadInputError
from rig.phrase import phrase

#: px that 1 m is in an image that is not oriented, about: a jumper is some 50 px tall.
PX_PER_M: Final = 30.0
_NO_POINT: Final = {
    PointState.FEW_RAYS: phrase("hand_few_rays", "fewer than two rays: measure the point in another image"),
    PointState.PARALLEL: phrase(
        "hand_parallel_rays", "rays parallel within their accuracy: add an image from another direction"
    ),
    PointState.BEHIND: phrase(
        "hand_rays_behind", "rays meet behind a camera: check whether the image points belong together"
    ),
    PointState.NOT_CONVERGED: phrase("hand_not_converged", "iteration did not converge: check the image points"),
}


class Views(Protocol):
    """Images in which a thing is tracked together."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the cameras."""

    @property
    def dimensions(self) -> int:
        """3 in space, 2 in an image by itself."""

    @property
    def unit(self) -> float:
        """How much of the coordinates 1 m is."""

    def project(self, name: str, place: Floats) -> tuple[Floats, Floats]:
        """Where a place appears, (2,) px, NaN behind the camera, and its derivatives (2, dimensions)."""

    def place(self, xy: Mapping[str, Floats], sigma: Mapping[str, float]) -> Floats:
        """The place of a thing from its image points (2,) px.

        Raises:
            BadInputError: they do not determine it; the message says why.
        """

    def shared(self, names: Sequence[str], place: Floats) -> Floats:
        """Covariance (2 n, 2 n) px^2 of what the uncertain cameras do to the image points of a place."""

    def px_per_m(self, name: str, place: Floats) -> float:
        """How large 1 m appears there."""


@dataclass(frozen=True, slots=True, eq=False)
class SpaceViews:
    """Oriented cameras."""

    system: CameraSystem
    names: tuple[str, ...]
    dimensions: int = 3
    unit: float = 1.0

    def project(self, name: str, place: Floats) -> tuple[Floats, Floats]:
        """See `Views`."""
        v, by_place, _ = self.system[name].linearised(place[None], np.zeros((1, 2)))
        if not self.system[name].in_front(place):
            return np.full(2, np.nan), by_place[0]
        return v[0], by_place[0]

    def place(self, xy: Mapping[str, Floats], sigma: Mapping[str, float]) -> Floats:
        """See `Views`."""
        names = tuple(xy)
        reduced = np.array([self.system[name].reduced(xy[name]) for name in names])
        found = intersect_points(
            [self.system[name].ideal() for name in names],
            reduced[None],
            sigma=np.array([sigma[name] for name in names]),
        )
        state = PointState(int(found.state[0]))
        if state is not PointState.OK:
            raise BadInputError(
                phrase(
                    "hand_no_point",
                    "the marks of {cameras} give no point: {why}",
                    cameras=", ".join(names),
                    why=_NO_POINT[state],
                )
            )
        return np.asarray(found.X[0])

    def shared(self, names: Sequence[str], place: Floats) -> Floats:
        """See `Views`."""
        rows = np.zeros((2 * len(names), len(self.system.covariance)))
        for i, name in enumerate(names):
            camera = self.system[name]
            rows[2 * i : 2 * i + 2, camera.columns] = camera.linearised(place[None], np.zeros((1, 2)))[2][0]
        return np.asarray(rows @ self.system.covariance @ rows.T)

    def px_per_m(self, name: str, place: Floats) -> float:
        """See `Views`."""
        camera = self.system[name]
        return float(camera.camera.interior[0] / np.linalg.norm(place - camera.position))


@dataclass(frozen=True, slots=True, eq=False)
class ImageView:
    """A camera that is not oriented, or the only one that shows a thing."""

    names: tuple[str, ...]
    dimensions: int = 2
    unit: float = PX_PER_M

    def project(self, name: str, place: Floats) -> tuple[Floats, Floats]:  # noqa: ARG002
        """See `Views`."""
        return place, np.eye(2)

    def place(self, xy: Mapping[str, Floats], sigma: Mapping[str, float]) -> Floats:  # noqa: ARG002
        """See `Views`."""
        return next(iter(xy.values()))

    def shared(self, names: Sequence[str], place: Floats) -> Floats:  # noqa: ARG002
        """See `Views`."""
        return np.zeros((2 * len(names),) * 2)

    def px_per_m(self, name: str, place: Floats) -> float:  # noqa: ARG002
        """See `Views`."""
        return PX_PER_M
