"""Measures the balls of an oriented log once more, as spheres in one light, and says where it comes from the side.

What finds the balls measures the centre of a blurred disc, whose size is free: good enough for names and a first
orientation, and wrong by up to half a radius where the sun lights one side alone, alike in all balls of an image. No
residual shows that: the poses turn.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from analysis.scene.camera_system import PlacedCamera, camera_system
from analysis.scene.detection import Detections
from analysis.scene.lit_fit import CommonLight, LitBalls, fit_lit_balls
from analysis.scene.lit_windows import sighted
from analysis.scene.static_image import StaticImage
from photogrammetry.adjustment.solution.adjustment import adjust_once
from photogrammetry.network.file import pixel_to_metric
from photogrammetry.network.file_writer import metric_to_pixel
from photogrammetry.network.model import Network
from photogrammetry.procedures.orientation import Orientation
from rig.arrays import Flags, Floats, Integers
from rig.phrase import Phrase, phrase

SMALL: Final = 0.9  #: of the radius: discs that look smaller than that are lit from the side
_EXPLAINED = 0.7  # of the variance around the background
_WORST_SIGMA = 0.25  # px
_FARTHEST = 0.75  # radii between disc and sphere: half a disc is not so far from the centre
_DISC_SIGMA = 0.25  # radii: how far a disc is off that no sphere explains
_SCATTER_ROUNDS = 8
_SCATTER_SETTLED = 0.97  # of the a-priori sigma0: nearer makes no sigma better


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredBalls:
    """n balls, measured as spheres in one light.

    Attributes:
        xy: (n, 2) centres, px; those of the discs where no sphere explains what is seen.
        sigma: (n, 2) px.
        whole: (n,) whether a sphere explains it.
        share: (n,) radius of the disc over that of the ball.
        light: in which they were measured.
        estimated: whether the radius was estimated from the images.
    """

    xy: Floats
    sigma: Floats
    whole: Flags
    share: Floats
    light: CommonLight
    estimated: bool

    def messages(self, camera: Integers, cameras: Sequence[str], balls: Sequence[str]) -> list[Phrase]:
        """What a person should know of the light.

        Args:
            camera: (n,) index of the camera of each.
            cameras: names of the cameras.
            balls: n names.
        """
        said: list[Phrase] = []
        aside = False
        for k, name in enumerate(cameras):
            of = camera == k
            usual = float(np.median(self.share[of])) if of.any() else 1.0
            if usual < SMALL:
                aside = True
                text = (
                    "camera {camera}: light comes from the side: the balls look {share:.2f} times as large as they "
                    "are; their centres are measured with this light"
                )
                said.append(phrase("scene_light_aside", text, camera=name, share=usual))
            if hidden := [balls[i] for i in np.flatnonzero(of & ~self.whole).tolist()]:
                text = (
                    "camera {camera}: not seen as whole balls in the light of the others, so they count little: {balls}"
                )
                said.append(phrase("scene_balls_covered", text, camera=name, balls=", ".join(hidden)))
        if self.estimated and aside:
            text = (
                "the radius of the balls is not given; {radius:.3f} m fits the images best; measure it and give it as "
                '"ball_radius_m" in the survey: a wrong radius moves all balls of an image alike'
            )
            said.append(phrase("scene_radius", text, radius=self.light.radius))
        return said


@dataclass(frozen=True, slots=True, eq=False)
class LitNetwork:
    """A network with balls that were measured as lit spheres.

    Attributes:
        network: with these centres, and with the radius of the balls.
        cameras: names of those that show them.
        light: in which they were measured, for these cameras.
        messages: what a person should know.
    """

    network: Network
    cameras: tuple[str, ...]
    light: CommonLight
    messages: tuple[Phrase, ...]


def measure_balls(
    placed: Sequence[PlacedCamera],
    static: Mapping[str, StaticImage],
    found: Mapping[str, Detections],
    camera: Integers,
    xyz: Floats,
    disc: Floats,
    radius: float | None,
) -> MeasuredBalls:
    """Measure balls whose discs were found and named, in oriented images, all in one light.

    Args:
        placed: the cameras, approximately.
        static: images by camera.
        found: the discs by camera.
        camera: (n,) index of the camera that sees each.
        xyz: (n, 3) the balls in space, approximately.
        disc: (n, 2) centres of their discs, px.
        radius: of the balls, metres; None: it is estimated.
    """
    balls = sighted(placed, camera, xyz, disc)
    size, covariance, bright = _discs([found[one.name] for one in placed], camera, disc)
    apparent = size / balls.radius_px(1.0)
    start = _start_radius(apparent, camera, bright) if radius is None else radius
    lit = fit_lit_balls([static[one.name] for one in placed], balls, start, known=radius is not None)
    true_size = balls.radius_px(lit.light.radius)
    sigma = np.sqrt(np.diagonal(lit.covariance, axis1=1, axis2=2))
    whole = is_ball(lit) & (np.hypot(*(lit.xy - disc).T) < np.maximum(1.0, _FARTHEST * true_size))
    of_disc = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2) + (_DISC_SIGMA * true_size[:, None]) ** 2)
    return MeasuredBalls(
        np.where(whole[:, None], lit.xy, disc),
        np.where(whole[:, None], sigma, of_disc),
        whole,
        apparent / lit.light.radius,
        lit.light,
        radius is None,
    )


def is_ball(lit: LitBalls) -> Flags:
    """Which of n measured balls (n,) a sphere in the common light explains."""
    sigma = np.sqrt(np.diagonal(lit.covariance, axis1=1, axis2=2))
    return np.asarray((lit.explained > _EXPLAINED) & (sigma.max(axis=1) < _WORST_SIGMA))


def with_lit_balls(
    network: Network, orientation: Orientation, static: Mapping[str, StaticImage], found: Mapping[str, Detections]
) -> LitNetwork:
    """The network with its balls measured as spheres in one light.

    Args:
        network: images are named as their cameras; `ball_radius_m` is used if it is there.
        orientation: of this network, by the centres of discs.
        static: images by camera.
        found: the discs by camera.
    """
    system = camera_system(orientation, tuple(static))
    names = system.names
    row, camera, xyz = _oriented_rows(network, orientation, names)
    o = network.observations
    sizes = np.array([system[name].size for name in names])[camera]
    disc = metric_to_pixel(o.xy[row], sizes)
    placed = [system[name] for name in names]
    measured = measure_balls(placed, static, found, camera, xyz, disc, network.ball_radius_m)
    xy, sigma = o.xy.copy(), o.sigma.copy()
    xy[row], sigma[row] = pixel_to_metric(measured.xy, sizes), measured.sigma
    points = [network.points[int(point)].name for point in o.point[row]]
    changed = replace(network, observations=replace(o, xy=xy, sigma=sigma), ball_radius_m=measured.light.radius)
    return LitNetwork(changed, names, measured.light, tuple(measured.messages(camera, names, points)))


def with_scatter(network: Network, orientation: Orientation) -> Network:
    """The network with sigmas of image points so small that the estimated sigma0 is the a-priori one.

    What the light does otherwise than the model shows in the pixels of every ball, and is partly alike in all of an
    image: the poses take that, and sigmas from pixels are too large for what is left. The sigmas of the survey, which
    are scaled by the same sigma0, would become too small.

    Args:
        network: the measured network.
        orientation: of this network.
    """
    a, factor = orientation.outcome.adjustment, 1.0
    for _ in range(_SCATTER_ROUNDS):
        if a.ratio > _SCATTER_SETTLED:  # larger sigmas would hide what is wrong with a camera
            break
        factor *= a.ratio
        a = adjust_once(_scaled(a.network, a.ratio), a.state)
    return _scaled(network, factor)


def _scaled(network: Network, factor: float) -> Network:
    """The network with the sigmas of image points multiplied by a factor."""
    o = network.observations
    return replace(network, observations=replace(o, sigma=o.sigma * factor))


def _start_radius(apparent: Floats, camera: Integers, bright: Flags) -> float:
    """Radius, metres, of bright discs in the camera that shows them largest: there they are most evenly lit."""
    chosen = bright if bright.any() else ~bright
    return max(float(np.median(apparent[chosen & (camera == k)])) for k in np.unique(camera[chosen]))


def _oriented_rows(
    network: Network, orientation: Orientation, names: Sequence[str]
) -> tuple[Integers, Integers, Floats]:
    """Observations of the network that are oriented: rows (n,), index of the camera (n,), object points (n, 3)."""
    a = orientation.outcome.adjustment
    place = {point.name: a.state.xyz[i] for i, point in enumerate(a.network.points)}
    o = network.observations
    cameras = [network.cameras[image.camera].name for image in network.images]
    rows = [
        (row, names.index(cameras[image]), place[network.points[point].name])
        for row, (image, point) in enumerate(zip(o.image.tolist(), o.point.tolist(), strict=True))
        if cameras[image] in names and network.points[point].name in place
    ]
    return (
        np.array([row for row, _, _ in rows], np.intp),
        np.array([camera for _, camera, _ in rows], np.intp),
        np.array([xyz for _, _, xyz in rows], float).reshape(-1, 3),
    )


def _discs(found: Sequence[Detections], camera: Integers, xy: Floats) -> tuple[Floats, Floats, Flags]:
    """Radii (n,), px, and covariances (n, 2, 2) of the discs at centres (n, 2), and which are brighter than around."""
    nearest = [
        (found[k], int(np.hypot(*(found[k].xy - place).T).argmin()))
        for k, place in zip(camera.tolist(), xy, strict=True)
    ]
    return (
        np.array([of.radius[i] for of, i in nearest], float),
        np.array([of.covariance[i] for of, i in nearest], float).reshape(-1, 2, 2),
        np.array([of.contrast[i] > 0 for of, i in nearest], bool),
    )
