"""What distortion bends within the window of a corner or a disc, and how far that moves what is fitted there.

A corner is fitted by straight edges and a disc by an ellipse; a lens bends both. To second order it shows a place u of
the window, in units of its reach S (columns: along the edges, or spanning the ellipse), at

    d(q + S u) = d(q) + d'(q) S u + 1/2 S h(u, u).

A straight line through an edge is off by the mean bend along it, 0.15 h(e1, e1) for the edge along e1. An ellipse
through a bent circle is off by the first harmonic of the displacement along the circle's normals, <u (u h(u, u))>:
(3 h1(e1, e1) + h1(e2, e2) + 2 h2(e1, e2)) / 8 along e1. But the bend of the distortion looks like perspective in part:
the homography through the four discs of a target takes h2(e1, e2) for a tilt of its plane, and with that so much along
e1 has been taken off already (`projected_centres`).
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from analysis.targets.network_of import Picture
from analysis.targets.pattern import has_circles
from photogrammetry.geometry.camera_model import Lens, distort, undistort
from photogrammetry.network.model import Network
from rig.arrays import Flags, Floats

#: Mean square of the places along an edge that its fit goes by, in units of the reach: a third for a sharp long one;
#: the response of the fit in windows of 5 to 9 px with edges 0.5 to 1.2 px wide is 0.25 to 0.35.
_ALONG: Final = 0.3
#: The pixel frame's y points down.
_UPWARDS: Final[Floats] = np.array([1.0, -1.0])


def unbent(network: Network, pictures: Sequence[Picture]) -> Network:
    """The network with image points where the lens shows the corners and centres themselves.

    Args:
        network: of pictures, at adjusted values of its interior orientations.
        pictures: its images.
    """
    o = network.observations
    seen = {picture.name: picture.sight.corners for picture in pictures}
    names = [point.name for point in network.points]
    disc = np.array([has_circles(name) for name in names])[o.point]
    corners = [seen[network.images[i].name][names[p]] for i, p in zip(o.image, o.point, strict=True)]
    reach = np.array([corner.reach for corner in corners]) * _UPWARDS[:, None]
    camera = np.array([image.camera for image in network.images])[o.image]
    xy = o.xy.copy()
    for number, one in enumerate(network.cameras):
        rows = camera == number
        xy[rows] -= moved_by_bending(one.lens(), xy[rows], reach[rows], disc[rows])
    return replace(network, observations=replace(o, xy=xy))


def moved_by_bending(lens: Lens, xy: Floats, reach: Floats, disc: Flags) -> Floats:
    """How far corners and discs are fitted beside where the lens shows them.

    Args:
        lens: that bends them.
        xy: (n, 2) where they are fitted, metric frame.
        reach: (n, 2, 2) of what was fitted; columns.
        disc: (n,) whether it is a disc; a corner otherwise.

    Returns:
        (n, 2), in the unit of `xy`; zero where the distortion has no inverse.
    """
    middle = undistort(lens, xy)

    def shown(first: int, second: int) -> Floats:
        return np.asarray(distort(lens, middle + first * reach[..., 0] + second * reach[..., 1]))

    twice = 2.0 * shown(0, 0)
    bends = (
        shown(1, 0) + shown(-1, 0) - twice,
        (shown(1, 1) + shown(-1, -1) - shown(1, -1) - shown(-1, 1)) / 4.0,
        shown(0, 1) + shown(0, -1) - twice,
    )
    # h(e1, e1), h(e1, e2) and h(e2, e2), each in units of the reach
    (h111, h112, h122), (h211, h212, h222) = np.moveaxis(np.linalg.inv(reach) @ np.stack(bends, axis=-1), 0, -1)
    of_disc = np.stack((3.0 * h111 + h122 - 6.0 * h212, 3.0 * h222 + h211 - 6.0 * h112), axis=-1) / 8.0
    of_corner = np.stack((h122, h211), axis=-1) * (_ALONG / 2.0)
    moved = np.einsum("nij,nj->ni", reach, np.where(disc[:, None], of_disc, of_corner))
    return np.where(np.isfinite(moved), moved, 0.0)
