"""Points in space from spots of which some belong to another marker."""

import numpy as np

from analysis.candidates.model import ImageCandidates, PulseCandidates, Spots
from analysis.identification.space.space_points import find_space_points, rays_of
from analysis.identification.space.views import Views
from rig.arrays import Floats
from rig.clocks import UtcNs
from rig.pulse import PulseNumber
from tests.analysis.simulated import SIGMA_PX, true_cameras


def test_what_hides_a_marker_does_not_take_its_other_rays() -> None:
    """The third camera sees one binding before the other: its only spot fits both, and must not be asked of both."""
    system = true_cameras()
    near = np.array((8.0, -0.3, -2.0))
    sight = near - system["K3"].position
    far = near + 0.45 * sight / np.linalg.norm(sight)
    both = np.stack((near, far))
    images = {name: _image(system[name].project(both)) for name in ("K1", "K2")}
    images["K3"] = _image(system["K3"].project(near[None]) + 0.3)
    views = Views(system)
    (points,) = find_space_points(views, rays_of(views, [PulseCandidates(PulseNumber(1), UtcNs(0), images)]))
    found = {tuple(rays) for rays in points.rays.tolist()}
    assert {(0, 0, 0), (1, 1, -1)} <= found
    exact = points.xyz[points.rays.tolist().index([1, 1, -1])]
    assert np.linalg.norm(exact - far) < 1e-6


def _image(xy: Floats) -> ImageCandidates:
    n = len(xy)
    sigma = np.tile(SIGMA_PX**2 * np.eye(2), (n, 1, 1))
    return ImageCandidates(Spots(xy, sigma, np.full(n, 1.6), np.full(n, 80.0), np.full(n, 9.0)))
