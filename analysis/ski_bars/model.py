"""What the images of a pair of skis should show, and how that changes with the unknowns.

A ski covers the share D of a pixel: the box of its width and length, blurred by the lens,

    D = [F((u + h) / b) - F((u - h) / b)] [F((t - t_tail) / b) - F((t - t_tip) / b)],

with the distance u across the projected axis, the distance t along it, the half width h, the blur b, px, and the normal
distribution F. Of two skis the nearer one hides the farther one, and both hide the static scene S of the log:

    I = S (1 - D_far) (1 - D_near) + B_far D_far (1 - D_near) + B_near D_near.

How wide a flat box of 102 x 18 mm appears depends on how it is edged, which nobody knows: so each ski has a width of
its own in each image. The brightness B is another one in each image too: the faces are lit differently.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import ndtr

from analysis.scene.camera_system import PlacedCamera
from analysis.ski_bars.bars import OF_POSE, OF_SHAPE, SKIS, Poses, axis_points
from analysis.ski_bars.pixels import Pixels, SkiView
from rig.arrays import Flags, Floats, Integers

POSE: Final = slice(0, SKIS * OF_POSE)
SHAPE: Final = slice(POSE.stop, POSE.stop + SKIS * OF_SHAPE)
#: From here on the axis is that of the shovel, which is bent and tapered otherwise, m from the binding.
SHOVEL_M: Final = 0.92
#: Boot and binding hide the ski within this distance from its binding, m.
BOOT_M: Final = 0.3
_NODES: Final = np.linspace(-1.7, 1.9, 19)  # m from the binding, of the polygon that the projected axis is
_INDEX: Final = np.arange(len(_NODES), dtype=float)
_TABLE: Final = 6 + 2 * (OF_POSE + 1)
_WHITE: Final = 255.0
_ROOT_TAU: Final = np.sqrt(2 * np.pi)


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
        by_unknowns: (n, unknowns).
        u, t: (n, 2) px across and along the axis of each ski, t from its binding on.
        s: (n, 2) m along each ski from its binding.
        cover: (n, 2) of the pixel by each ski.
        by_u, by_t: (n, 2) derivatives of the grey value by the pixel's place across and along each ski.
        half: (n, 2) px.
    """

    grey: Floats
    by_unknowns: Floats
    u: Floats
    t: Floats
    s: Floats
    cover: Floats
    by_u: Floats
    by_t: Floats
    half: Floats


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
        self._by_place = [_derivatives(view.camera, places + view.shift) for view in views]

    @property
    def unknowns(self) -> Unknowns:
        """Where the unknowns stand."""
        return Unknowns(len(self.views))

    def poses(self, x: Floats) -> Poses:
        """The poses that unknowns mean."""
        return self.start.moved(x[POSE].reshape(SKIS, OF_POSE))

    def predicted(self, pixels: Pixels, x: Floats, *, derivatives: bool = True) -> Predicted:
        """What pixels should show.

        Args:
            pixels: n of them.
            x: unknowns.
            derivatives: whether they are wanted; they are zero otherwise.
        """
        at, poses = self.unknowns, self.poses(x)
        shape = x[SHAPE].reshape(SKIS, OF_SHAPE)
        axes = self._axes(poses, shape[:, 0])
        n, c = len(pixels.camera), pixels.camera
        rows = np.arange(n)
        rate = np.zeros((n, at.size))
        u, t, s = (np.full((n, SKIS), np.inf) for _ in range(3))
        cover, half, by_u, by_t = (np.zeros((n, SKIS)) for _ in range(4))
        blur = np.exp(x[at.blur])[c]
        parts = []
        for k in np.flatnonzero(self.present).tolist():
            foot = axes.foot(pixels, k)
            h = np.exp(x[at.width[:, k]])[c] * foot.scale
            tail, tip = ((foot.s - end) * foot.px_per_m for end in shape[k, 1:])
            left, right = (foot.u + h) / blur, (foot.u - h) / blur
            across, along = ndtr(left) - ndtr(right), ndtr(tail / blur) - ndtr(tip / blur)
            cover[:, k], u[:, k], s[:, k], half[:, k] = across * along, foot.u, foot.s, h
            t[:, k] = foot.t
            parts.append((k, foot, across, along, left, right, tail / blur, tip / blur, h))
        near = axes.nearer[c]
        far = 1 - near
        brightness = x[at.brightness][c]
        d_near, d_far = cover[rows, near], cover[rows, far]
        b_near, b_far = brightness[rows, near], brightness[rows, far]
        seen_through = pixels.behind * (1 - d_far) + b_far * d_far
        grey = seen_through * (1 - d_near) + b_near * d_near
        if derivatives:
            by_cover = np.empty((n, SKIS))
            by_cover[rows, near] = b_near - seen_through
            by_cover[rows, far] = (b_far - pixels.behind) * (1 - d_near)
            for k, foot, across, along, left, right, tail, tip, h in parts:
                p_left, p_right, p_tail, p_tip = (_density(value) for value in (left, right, tail, tip))
                on_u = (p_left - p_right) / blur * along * by_cover[:, k]
                on_t = across * (p_tail - p_tip) / blur * by_cover[:, k]
                by_u[:, k], by_t[:, k] = on_u, on_t
                rate[:, OF_POSE * k : OF_POSE * (k + 1)] = (
                    -on_u[:, None] * foot.across[:, :OF_POSE] - on_t[:, None] * foot.along[:, :OF_POSE]
                )
                first = SHAPE.start + OF_SHAPE * k
                rate[:, first] = -on_u * foot.across[:, OF_POSE]
                rate[:, first + 1] = -across * p_tail / blur * foot.px_per_m * by_cover[:, k]
                rate[:, first + 2] = across * p_tip / blur * foot.px_per_m * by_cover[:, k]
                by_blur = -(p_left * left - p_right * right) * along - across * (p_tail * tail - p_tip * tip)
                rate[rows, at.blur[c]] += by_blur * by_cover[:, k]
                rate[rows, at.width[c, k]] = (p_left + p_right) * h / blur * along * by_cover[:, k]
            rate[rows, at.brightness[c, near]] = d_near
            rate[rows, at.brightness[c, far]] = d_far * (1 - d_near)
        return Predicted(np.minimum(grey, _WHITE), rate, u, t, s, cover, by_u, by_t, half)

    def _axes(self, poses: Poses, bend: Floats) -> "_Axes":
        """Both axes in all images, as polygons."""
        places, by = axis_points(poses, bend, _NODES, self._across)
        m = len(self.views)
        along = np.empty((m, SKIS, len(_NODES)))
        table = np.empty((m, SKIS, len(_NODES), _TABLE))
        first, chord, nearer = np.empty((m, SKIS, 2)), np.empty((m, SKIS, 2)), np.empty(m, np.intp)
        for c, view in enumerate(self.views):
            there = places + view.shift
            xy = view.camera.project(there)
            distance = np.linalg.norm(there - view.camera.position, axis=-1)
            nearer[c] = int(distance.mean(axis=1).argmin())
            slope = _slope(xy)
            px_per_m = np.hypot(slope[..., 0], slope[..., 1])
            tangent = slope / px_per_m[..., None]
            normal = np.stack((-tangent[..., 1], tangent[..., 0]), axis=-1)
            rate = self._by_place[c] @ by
            first[c] = xy[:, 0]
            chord[c] = xy[:, -1] - xy[:, 0]
            chord[c] /= np.linalg.norm(chord[c], axis=-1, keepdims=True)
            along[c] = ((xy - xy[:, :1]) * chord[c][:, None]).sum(axis=-1)
            table[c] = np.concatenate(
                (
                    xy,
                    tangent,
                    (view.camera.camera.interior[0] / distance)[..., None],
                    px_per_m[..., None],
                    (normal[..., None, :] @ rate)[..., 0, :],
                    (tangent[..., None, :] @ rate)[..., 0, :],
                ),
                axis=-1,
            )
        return _Axes(first, chord, along, table, nearer)


@dataclass(frozen=True, slots=True, eq=False)
class _Foot:
    """The feet of n pixels on one axis.

    Attributes:
        u, t, s: (n,) as in `Predicted`.
        scale, px_per_m: (n,) px per m across and along the axis.
        across, along: (n, 6) derivatives of the foot by pose and bend.
    """

    u: Floats
    t: Floats
    s: Floats
    scale: Floats
    px_per_m: Floats
    across: Floats
    along: Floats


@dataclass(frozen=True, slots=True, eq=False)
class _Axes:
    """Polygons of k nodes that both axes are in m images.

    Attributes:
        first: (m, 2, 2) px, the first node.
        chord: (m, 2, 2) unit vectors to the last node.
        along: (m, 2, k) px, where the nodes stand along it.
        table: (m, 2, k, 18) of each node: its place, the tangent, px per m across and along, and derivatives of its
            place across and along by pose and bend.
        nearer: (m,) the ski that is nearer to the camera.
    """

    first: Floats
    chord: Floats
    along: Floats
    table: Floats
    nearer: Integers

    def foot(self, pixels: Pixels, k: int) -> _Foot:
        """The feet of pixels on the axis of ski k."""
        c, last = pixels.camera, len(_NODES) - 2
        chord, first = self.chord[c, k], self.first[c, k]
        t = (pixels.xy[:, 0] - first[:, 0]) * chord[:, 0] + (pixels.xy[:, 1] - first[:, 1]) * chord[:, 1]
        node, binding = np.empty(len(t)), np.empty(len(t))
        for camera in range(len(self.chord)):
            here = c == camera
            node[here] = np.interp(t[here], self.along[camera, k], _INDEX, left=-1, right=last + 2)
            binding[here] = np.interp(0.0, _NODES, self.along[camera, k])
        i = np.clip(node.astype(np.intp), 0, last)
        share = np.clip(node - i, 0.0, 1.0)[:, None]
        row = (c * SKIS + k) * len(_NODES) + i
        table = self.table.reshape(-1, _TABLE)
        at = table[row] * (1 - share) + table[row + 1] * share
        off_x, off_y = pixels.xy[:, 0] - at[:, 0], pixels.xy[:, 1] - at[:, 1]
        u, rest = at[:, 2] * off_y - at[:, 3] * off_x, at[:, 2] * off_x + at[:, 3] * off_y
        s = np.interp(i + share[:, 0], _INDEX, _NODES) + rest / at[:, 5]
        return _Foot(u, t - binding, s, at[:, 4], at[:, 5], at[:, 6 : 7 + OF_POSE], at[:, 7 + OF_POSE :])


def _derivatives(camera: PlacedCamera, places: Floats) -> Floats:
    """Derivatives (..., 2, 3) of image points by places (..., 3)."""
    px = np.nan_to_num(camera.project(places))
    return camera.linearised(places.reshape(-1, 3), px.reshape(-1, 2))[1].reshape(*places.shape[:-1], 2, 3)


def _slope(xy: Floats) -> Floats:
    """Derivatives of the nodes (2, k, 2) by the way along the ski, px per m."""
    step = (xy[:, 1:] - xy[:, :-1]) / (_NODES[1] - _NODES[0])
    return np.concatenate((step[:, :1], (step[:, 1:] + step[:, :-1]) / 2, step[:, -1:]), axis=1)


def _density(value: Floats) -> Floats:
    return np.asarray(np.exp(-0.5 * value * value) / _ROOT_TAU)


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
