"""Seeks surveyed balls where the poses say that they are, in the light of those that were found.

What finds balls without knowing anything needs a disc before an even ground. A ball before snow, at the border of a
shadow or half before its own plate is no such disc, but it is a sphere of known size in known light at a known place.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from analysis.scene.camera_system import CameraSystem, PlacedCamera, camera_system
from analysis.scene.lit_balls import LitNetwork, is_ball
from analysis.scene.lit_fit import fit_in_known_light
from analysis.scene.lit_windows import sighted
from analysis.scene.naming import GATE
from analysis.scene.static_image import StaticImage
from analysis.scene.survey import Survey
from photogrammetry.network.file import pixel_to_metric
from photogrammetry.network.model import Network, Point
from photogrammetry.procedures.orientation import Orientation
from rig.arrays import Floats, Integers
from rig.phrase import Phrase, phrase

_NEAREST = 1.0  # radii: a prediction that is worse than that may lead to something else


@dataclass(frozen=True, slots=True, eq=False)
class _Sought:
    """n balls that no image point of a camera is known of.

    Attributes:
        camera: (n,) index of the camera.
        point: n points.
        xyz: (n, 3) where they are.
        xy: (n, 2) where they should appear, px.
        covariance: (n, 2, 2) of that, px^2.
    """

    camera: Integers
    point: Sequence[Point]
    xyz: Floats
    xy: Floats
    covariance: Floats

    def only(self, chosen: Integers) -> "_Sought":
        """Some of them."""
        points = [self.point[i] for i in chosen.tolist()]
        return _Sought(self.camera[chosen], points, self.xyz[chosen], self.xy[chosen], self.covariance[chosen])


def with_sought_balls(
    lit: LitNetwork, orientation: Orientation, static: Mapping[str, StaticImage], survey: Survey
) -> LitNetwork:
    """The network with those balls, too, that are seen only by one who knows where they are.

    Args:
        lit: what was found.
        orientation: of its network.
        static: images by camera.
        survey: of the balls.
    """
    system = camera_system(orientation, tuple(static))
    placed = [system[name] for name in system.names]
    sought = _sought(lit.network, orientation, survey, system)
    balls = sighted(placed, sought.camera, sought.xyz, sought.xy)
    size = balls.radius_px(lit.light.radius)
    worst = np.sqrt(np.linalg.eigvalsh(sought.covariance)[:, -1]) if len(size) else size
    room = np.array([one.size for one in placed])[sought.camera] - 1
    inside = ((sought.xy > size[:, None]) & (sought.xy < room - size[:, None])).all(axis=1)
    near = np.flatnonzero(inside & (worst < _NEAREST * size))
    if not len(near):
        return lit
    sought, balls = sought.only(near), balls.only(near)
    images = [static[one.name] for one in placed]
    light = lit.light.only(np.array([lit.cameras.index(one.name) for one in placed], np.intp))
    found = fit_in_known_light(images, balls, light)
    off = found.xy - sought.xy
    spread = sought.covariance + found.covariance
    squares = (off * np.linalg.solve(spread, off[..., None])[..., 0]).sum(axis=1)
    seen = np.flatnonzero(is_ball(found) & (squares < GATE))
    if not len(seen):
        return lit
    sought, xy = sought.only(seen), found.xy[seen]
    sigma = np.sqrt(np.diagonal(found.covariance[seen], axis1=1, axis2=2))
    network = _with_observations(lit.network, sought, placed, xy, sigma)
    return replace(lit, network=network, messages=(*lit.messages, *_messages(sought, placed)))


def _sought(network: Network, orientation: Orientation, survey: Survey, system: CameraSystem) -> _Sought:
    """The balls of the network and of the survey in those images in which they were not found."""
    a = orientation.outcome.adjustment
    sigma = a.sigmas(a.problem.unknowns.point)
    balls = {point.name: (point, a.state.xyz[i], np.diag(sigma[i] ** 2)) for i, point in enumerate(a.network.points)}
    known, given = survey.surveyed(), {point.name: point for point in survey.network.points}
    for name, xyz, covariance in zip(known.names, known.xyz, known.covariance, strict=True):
        balls.setdefault(name, (given[name], xyz, covariance))
    o = network.observations
    names = [network.cameras[image.camera].name for image in network.images]
    seen = {(names[i], network.points[j].name) for i, j in zip(o.image.tolist(), o.point.tolist(), strict=True)}
    rows = []
    for k, name in enumerate(system.names):
        for ball, (point, xyz, covariance) in balls.items():
            if (name, ball) not in seen and system[name].in_front(xyz):
                rows.append((k, point, xyz, *_predicted(system, system[name], xyz, covariance)))
    columns = list(zip(*rows, strict=True)) if rows else [()] * 5
    return _Sought(
        np.array(columns[0], np.intp),
        columns[1],
        np.array(columns[2], float).reshape(-1, 3),
        np.array(columns[3], float).reshape(-1, 2),
        np.array(columns[4], float).reshape(-1, 2, 2),
    )


def _predicted(system: CameraSystem, camera: PlacedCamera, xyz: Floats, covariance: Floats) -> tuple[Floats, Floats]:
    """Where a point appears, px, and the covariance of that."""
    xy = camera.project(xyz)
    _, by_point, by_camera = camera.linearised(xyz[None], xy[None])
    of_camera = system.covariance[np.ix_(camera.columns, camera.columns)]
    return xy, by_point[0] @ covariance @ by_point[0].T + by_camera[0] @ of_camera @ by_camera[0].T


def _with_observations(
    network: Network, sought: _Sought, placed: Sequence[PlacedCamera], xy: Floats, sigma: Floats
) -> Network:
    """The network with balls at xy (n, 2), px; sigma (n, 2)."""
    points = {point.name: point for point in (*network.points, *sought.point)}
    place = {name: i for i, name in enumerate(points)}
    images = {network.cameras[image.camera].name: i for i, image in enumerate(network.images)}
    sizes = np.array([one.size for one in placed])[sought.camera]
    o = network.observations
    joined = replace(
        o,
        image=np.append(o.image, [images[placed[k].name] for k in sought.camera.tolist()]),
        point=np.append(o.point, [place[point.name] for point in sought.point]),
        xy=np.concatenate((o.xy, pixel_to_metric(xy, sizes))),
        sigma=np.concatenate((o.sigma, sigma)),
        group=np.append(o.group, np.zeros(len(xy), np.intp)),
    )
    return replace(network, points=tuple(points.values()), observations=joined)


def _messages(sought: _Sought, placed: Sequence[PlacedCamera]) -> list[Phrase]:
    said = []
    for k, one in enumerate(placed):
        if names := [sought.point[i].name for i in np.flatnonzero(sought.camera == k).tolist()]:
            text = "camera {camera}: seen only where its pose says that they are: {balls}"
            said.append(phrase("scene_balls_sought", text, camera=one.name, balls=", ".join(names)))
    return said
