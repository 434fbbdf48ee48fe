"""What the images of a pair of skis should show, and how that changes with the unknowns.

A ski covers the share D of a pixel: the box of its width and length, blurred by the lens,

    D = [F((u + h) / b) - F((u - h) / b)] [F((t - t_tail) / b) - F((t - t_tip) / b)],

with the distance u across the projected axis, the distance t along it, the half width h, the blur b, px, and the normal
distribution F. Of two skis the nearer one hides the farther one, and both hide the static scene S of the log:

    I = S (1 - D_far) (1 - D_near) + B_far D_far (1 - D_near) + B_near D_near.

Unknowns and places along the axes are 64 bits wide, what is said of pixels 32: they are noisier than that.

How wide a flat box of 102 x 18 mm appears depends on how it is edged, which nobody knows: so each ski has a width of
its own in each image. The brightness B is another one in each image too: the faces are lit differently.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from analysis.scene.camera_system import PlacedCamera
from analysis.ski_bars.bars import OF_POSE, OF_SHAPE, SKIS, Poses, axis_points
from analysis.ski_bars.pixels import Pixels, SkiView
from rig.arrays import Flags, Floats, Integers, Reals

POSE: Final = slice(0, SKIS * OF_POSE)
SHAPE: Final = slice(POSE.stop, POSE.stop + SKIS * OF_SHAPE)
#: From here on the axis is that of the shovel, which is bent and tapered otherwise, m from the binding.
SHOVEL_M: Final = 0.92
#: Boot and binding hide the ski within this distance from its binding, m.
BOOT_M: Final = 0.3
_NODES: Final = np.linspace(-1.7, 1.9, 19)  # m from the binding, where the axis is projected
#: Between them it is a polynomial of the way along the ski, in each image: its error is under 0.001 px.
_POWERS: Final = 6
_FROM_NODES: Final = np.linalg.pinv(np.vander(_NODES, _POWERS).T)
_SLOPES: Final = (_FROM_NODES[:, :-1] @ (np.arange(_POWERS - 1, 0, -1) * np.vander(_NODES, _POWERS - 1)).T).T
_PLACES: Final = 6  # of a node without derivatives
_WHITE: Final = 255.0
_ROOT_TAU: Final = float(np.sqrt(2 * np.pi))
_FARTHEST: Final = 8.0  # standard deviations, beyond which the normal distribution is 0 or 1


@dataclass(frozen=True, slots=True, eq=False)
class Unknowns:
    """Where the unknowns of m cameras stand: poses, shapes, then of each camera log blur, log half widths, brightness.

    Attributes:
        cameras: m.
    """

    cameras: int

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return SHAPE.stop + self.cameras * (1 + 2 * SKIS)

    @property
    def blur(self) -> Integers:
        """(m,) log of the blur, px."""
        return SHAPE.stop + np.arange(self.cameras)

    @property
    def width(self) -> Integers:
        """(m, 2) log of the half width, m."""
        return SHAPE.stop + self.cameras + np.arange(SKIS * self.cameras).reshape(-1, SKIS)

    @property
    def brightness(self) -> Integers:
        """(m, 2) grey value."""
        return SHAPE.stop + self.cameras * (1 + SKIS) + np.arange(SKIS * self.cameras).reshape(-1, SKIS)


@dataclass(frozen=True, slots=True, eq=False)
class Predicted:
    """What n pixels should show.

    Attributes:
        grey: (n,).
        by_unknowns: (unknowns, n).
        u, t: (2, n) px across and along the axis of each ski, t from its binding on.
        s: (2, n) m along each ski from its binding.
        cover: (2, n) of the pixel by each ski.
        by_u, by_t: (2, n) derivatives of the grey value by the pixel's place across and along each ski.
        half: (2, n) px.
    """

    grey: Reals
    by_unknowns: Reals
    u: Reals
    t: Reals
    s: Reals
    cover: Reals
    by_u: Reals
    by_t: Reals
    half: Reals


class BarModel:
    """The images of a pair of skis.

    Args:
        views: of the m cameras.
        start: poses from which the unknowns of the pose count.
        present: of both skis, which are there to be fitted.
    """

    def __init__(self, views: Sequence[SkiView], start: Poses, present: tuple[bool, bool] = (True, True)) -> None:
        self.views, self.start, self.present = views, start, present
        self._across = start.axes()
        places, _ = axis_points(start, np.zeros(SKIS), _NODES, self._across)
        # A ski moves by centimetres in a fit, and the derivatives of its image by parts in a thousand.
        self._by_place = np.array([_derivatives(view.camera, places + view.shift) for view in views])
        self._shift = np.array([view.shift for view in views])[:, None, None]
        self._position = np.array([view.camera.position for view in views])[:, None, None]
        self._c = np.array([view.camera.camera.interior[0] for view in views])[:, None, None]
        self._latest: tuple[Pixels, Floats, bool, _Feet] | None = None

    @property
    def unknowns(self) -> Unknowns:
        """Where the unknowns stand."""
        return Unknowns(len(self.views))

    def poses(self, x: Floats) -> Poses:
        """The poses that unknowns mean."""
        return self.start.moved(x[POSE].reshape(SKIS, OF_POSE), self._across)

    def predicted(self, pixels: Pixels, x: Floats, *, derivatives: bool = True) -> Predicted:
        """What pixels should show.

        Args:
            pixels: n of them.
            x: unknowns.
            derivatives: whether they are wanted; they are zero otherwise.
        """
        at = self.unknowns
        x32 = x.astype(np.float32)
        shape = x32[SHAPE].reshape(SKIS, OF_SHAPE)
        feet = self._feet_at(pixels, x, derivatives=derivatives)
        c = pixels.camera
        blur = np.exp(x32[at.blur])[c]
        half = np.exp(x32[at.width]).T[:, c] * feet.scale
        tail, tip = ((feet.s - shape[:, end, None]) * feet.px_per_m for end in (1, 2))
        edges = np.stack((feet.u + half, feet.u - half, tail, tip)) / blur
        (p_left, p_right, p_tail, p_tip), (left, right, behind_tail, behind_tip) = _normal(edges)
        across, along = left - right, behind_tail - behind_tip
        cover = across * along
        absent = [k for k in range(SKIS) if not self.present[k]]
        cover[absent] = 0.0
        hides = np.stack(((feet.nearer == 0)[c], (feet.nearer == 1)[c])).astype(np.float32)  # the other ski
        shown, through = 1 - hides[::-1] * cover[::-1], pixels.behind * (1 - cover[::-1])
        bright = x32[at.brightness].T[:, c]
        grey = through[0] * (1 - cover[0]) + (bright * cover * shown).sum(axis=0)
        rate = np.zeros((at.size, len(c)), np.float32)
        by_u, by_t = np.zeros_like(cover), np.zeros_like(cover)
        if derivatives:
            by_cover = bright * shown - through - hides * (bright * cover)[::-1]
            by_cover[absent] = 0.0
            on_sides, on_ends = along * by_cover, across * by_cover
            by_edges = np.stack((p_left * on_sides, -p_right * on_sides, p_tail * on_ends, -p_tip * on_ends)) / blur
            by_blur = -(edges * by_edges).sum(axis=(0, 1)) * blur
            by_width = (by_edges[0] - by_edges[1]) * half
            by_u, by_t = by_edges[0] + by_edges[1], by_edges[2] + by_edges[3]
            on_pose = rate[POSE].reshape(SKIS, OF_POSE, -1)
            np.multiply(feet.across[:, :OF_POSE], -by_u[:, None], out=on_pose)
            on_pose -= feet.along[:, :OF_POSE] * by_t[:, None]
            on_shape = rate[SHAPE].reshape(SKIS, OF_SHAPE, -1)
            on_shape[:, 0] = -by_u * feet.across[:, OF_POSE]
            on_shape[:, 1:] = -(by_edges[2:] * feet.px_per_m).swapaxes(0, 1)
            by_bright = cover * shown
            for camera, here in enumerate(pixels.of_cameras(len(self.views))):
                rate[at.blur[camera], here] = by_blur[here]
                rate[at.width[camera], here] = by_width[:, here]
                rate[at.brightness[camera], here] = by_bright[:, here]
        u, t, s = (of.copy() if absent else of for of in (feet.u, feet.t, feet.s))
        for of in (u, t, s):
            of[absent] = np.inf
        half[absent] = 0.0
        return Predicted(np.minimum(grey, _WHITE), rate, u, t, s, cover, by_u, by_t, half)

    def _feet_at(self, pixels: Pixels, x: Floats, *, derivatives: bool) -> "_Feet":
        """The feet at unknowns; those of the latest call where neither poses nor bends have changed."""
        bend = x[SHAPE][::OF_SHAPE]
        axes = np.concatenate((x[POSE], bend))
        if self._latest is not None:
            of, at, complete, feet = self._latest
            if of is pixels and (complete or not derivatives) and (at == axes).all():
                return feet
        feet = self._feet(pixels, self.poses(x), bend, derivatives=derivatives)
        self._latest = pixels, axes, derivatives, feet
        return feet

    def _feet(self, pixels: Pixels, poses: Poses, bend: Floats, *, derivatives: bool) -> "_Feet":
        """The feet of pixels on both axes."""
        places, by = axis_points(poses, bend, _NODES, self._across)
        n, m = len(pixels.camera), len(self.views)
        rows = _PLACES + (2 * (OF_POSE + 1) if derivatives else 0)
        at, off = np.empty((SKIS, rows, n), np.float32), np.empty((SKIS, 2, n), np.float32)
        s, t = np.empty((2, SKIS, n), np.float32)
        there = places + self._shift
        xy = np.array([view.camera.project(of) for view, of in zip(self.views, there, strict=True)])
        distance = np.sqrt(((there - self._position) ** 2).sum(axis=-1))
        table = np.empty((m, SKIS, len(_NODES), rows))
        slope = _SLOPES @ xy
        table[..., :2], table[..., 5] = xy, np.hypot(slope[..., 0], slope[..., 1])
        table[..., 2:4] = slope / table[..., 5:6]
        table[..., 4] = self._c / distance
        middle = _PLACES + OF_POSE + 1
        if derivatives:
            right, down = np.moveaxis(self._by_place @ by, -2, 0)
            table[..., _PLACES:middle] = table[..., 2:3] * down - table[..., 3:4] * right
            table[..., middle:] = table[..., 2:3] * right + table[..., 3:4] * down
        polynomials = table.swapaxes(2, 3) @ _FROM_NODES
        narrow = polynomials.astype(np.float32)
        chord = xy[:, :, -1] - xy[:, :, 0]
        chord /= np.hypot(chord[..., 0], chord[..., 1])[..., None]
        nodes = (xy @ chord[..., None])[..., 0]
        for c, here in enumerate(pixels.of_cameras(m)):
            for k in range(SKIS):
                way = pixels.xy[here] @ chord[c, k]
                s[k, here] = along = np.interp(way, nodes[c, k], _NODES)
                t[k, here] = way - np.interp(0.0, _NODES, nodes[c, k])
                powers = _powers(along)
                off[k, :, here] = pixels.xy[here].T - polynomials[c, k, :2] @ powers
                at[k, 2:, here] = narrow[c, k, 2:] @ powers.astype(np.float32)
        u = at[:, 2] * off[:, 1] - at[:, 3] * off[:, 0]
        s += (at[:, 2] * off[:, 0] + at[:, 3] * off[:, 1]) / at[:, 5]
        nearer = distance.mean(axis=-1).argmin(axis=-1)
        return _Feet(u, t, s, at[:, 4], at[:, 5], at[:, _PLACES:middle], at[:, middle:], nearer)


@dataclass(frozen=True, slots=True, eq=False)
class _Feet:
    """The feet of n pixels on both axes.

    Attributes:
        u, t, s: (2, n) as in `Predicted`.
        scale, px_per_m: (2, n) px per m across and along the axis.
        across, along: (2, 6, n) derivatives of the foot by pose and bend; empty where they are not wanted.
        nearer: by camera the ski that is nearer to it.
    """

    u: Reals
    t: Reals
    s: Reals
    scale: Reals
    px_per_m: Reals
    across: Reals
    along: Reals
    nearer: Integers


def _powers(s: Floats) -> Floats:
    """Powers (6, n) of values (n,), the highest first, as those of `numpy.vander`."""
    powers = np.ones((_POWERS, len(s)))
    for i in reversed(range(_POWERS - 1)):
        np.multiply(powers[i + 1], s, out=powers[i])
    return powers


def _derivatives(camera: PlacedCamera, places: Floats) -> Floats:
    """Derivatives (..., 2, 3) of image points by places (..., 3)."""
    px = np.nan_to_num(camera.project(places))
    return camera.linearised(places.reshape(-1, 3), px.reshape(-1, 2))[1].reshape(*places.shape[:-1], 2, 3)


def _normal(value: Reals) -> tuple[Reals, Reals]:
    """Density and distribution function of the normal distribution, the latter within 1e-7.

    Abramowitz and Stegun, Handbook of Mathematical Functions, 26.2.17: faster than that of SciPy by far.
    """
    away = np.minimum(np.abs(value), _FARTHEST)
    density = np.exp(-0.5 * away * away) / _ROOT_TAU
    t = 1 / (1 + 0.2316419 * away)
    tail = density * t * (0.319381530 + t * (-0.356563782 + t * (1.781477937 + t * (-1.821255978 + t * 1.330274429))))
    return density, np.where(value < 0, tail, 1 - tail)


def hidden_by_boots(model: BarModel, x: Floats, pixels: Pixels) -> Flags:
    """Which pixels (n,) boots and bindings may hide."""
    poses, near = model.poses(x), np.zeros(len(pixels.camera), bool)
    for c, view in enumerate(model.views):
        here = pixels.camera == c
        places = poses.point + view.shift
        px = view.camera.project(places)
        radius = BOOT_M * view.camera.camera.interior[0] / np.linalg.norm(places - view.camera.position, axis=1)
        away = np.linalg.norm(pixels.xy[here][:, None] - px, axis=-1)
        near[here] = (away < radius).any(axis=1)
    return near
