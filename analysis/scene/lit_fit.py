"""Measures the centres of balls of one radius that one light lights: all balls of all images at once.

Unknown are the centre of each ball, the light that is common to all, gain and blur of each camera, and the radius where
nobody gives it. The centres are eliminated (Schur complement). Levenberg and Marquardt; pixels count less beyond 2.5
standard deviations (Huber).

A pixel's variance is that of its noise and (k C)^2, the model's error in proportion to the ball's contrast C: real
surfaces, shadows and dirt are no sphere of one colour. k is estimated from the residuals of each ball. Neighbouring
pixels have this error in common, which the covariance of the centres knows.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import log

import numpy as np

from analysis.scene.ground import BLUR
from analysis.scene.lit_sphere import LIGHT, UNKNOWNS, Light, sphere_images
from analysis.scene.lit_windows import FULL, SightedBalls, Windows, windows
from analysis.scene.static_image import StaticImage
from rig.arrays import Floats, Integers

_BLUR_SPREAD, _GAIN_SPREAD = 0.25, 0.3  # of logs, priors of each camera
_RADIUS_SPREAD = 0.2  # of its log, where it is not known
_HELD = 1e-6  # spread of a log that stays
_SMALLEST_BLUR = 0.55  # px
_LIGHT_SPREAD = np.array([3.0, 0.5, 2.0, 2.0, 2.0])  # of the light, in units of the balls' brightness
_ROUNDING = 0.08  # grey values squared
_HUBER = 2.5
_MODEL_START, _MODEL_LEAST = 0.05, 0.002  # k
_MODEL_FREEDOM = 30  # pixels that the median of an image counts for in a ball's own k
_CORRELATED = 0.5  # of the radius: over so far the model's error is alike (or over _CORRELATED_LEAST px)
_CORRELATED_LEAST = 1.5
_STEPS_MOST, _STEPS_REWEIGHTED = 15, 8
_SETTLED_PX = 2e-3  # px
_FARTHEST = 1.5  # px per step


@dataclass(frozen=True, slots=True, eq=False)
class LitBalls:
    """n measured balls.

    Attributes:
        xy: (n, 2) centres, px.
        covariance: (n, 2, 2) px^2.
        explained: (n,) share of the variance around the background that the ball explains.
        light: in which they were measured.
    """

    xy: Floats
    covariance: Floats
    explained: Floats
    light: "CommonLight"


@dataclass(frozen=True, slots=True, eq=False)
class CommonLight:
    """What all balls of a log have in common.

    Attributes:
        unit: grey value of the balls.
        common: light in that unit, log gain and log blur of each camera, log radius of the balls (metres).
    """

    unit: float
    common: Floats

    @property
    def radius(self) -> float:
        """Of the balls, metres."""
        return float(np.exp(self.common[-1]))

    def only(self, cameras: Integers) -> "CommonLight":
        """For some of the cameras, by index."""
        count = (len(self.common) - LIGHT - 1) // 2
        own = np.concatenate((np.arange(LIGHT), LIGHT + cameras, LIGHT + count + cameras, [LIGHT + 2 * count]))
        return CommonLight(self.unit, self.common[own])


@dataclass(slots=True, eq=False)
class _State:
    xy: Floats
    common: Floats  # light in units of the brightness; log gains; log blurs; log radius


def fit_lit_balls(static: Sequence[StaticImage], balls: SightedBalls, radius: float, *, known: bool) -> LitBalls:
    """Measure balls, and the light that they have in common.

    Args:
        static: image of each camera.
        balls: where they are approximately, and how the cameras see them.
        radius: of the balls, metres; approximate if it is not known.
        known: whether it is exact.
    """
    cameras = len(static)
    common = np.zeros(LIGHT + 2 * cameras + 1)
    common[LIGHT + cameras : LIGHT + 2 * cameras] = log(BLUR)
    common[-1] = log(radius)
    common[0] = 1.0
    spread = np.concatenate((_LIGHT_SPREAD, np.full(cameras, _GAIN_SPREAD), np.full(cameras, _BLUR_SPREAD), [_HELD]))
    fit = _Fit(static, balls, common, spread)
    fit.adjust(_STEPS_MOST, clipped=False)
    fit.weigh(clipped=False)
    if not known:
        fit.release_radius()
    fit.again()
    fit.adjust(_STEPS_MOST, clipped=True)
    for _ in range(2):
        fit.weigh(clipped=True)
        fit.adjust(_STEPS_REWEIGHTED, clipped=True)
    return fit.result()


def fit_in_known_light(static: Sequence[StaticImage], balls: SightedBalls, light: CommonLight) -> LitBalls:
    """Measure balls in the light of others.

    Args:
        static: image of each camera.
        balls: where they should be, and how the cameras see them.
        light: of the others.
    """
    fit = _Fit(static, balls, light.common, np.full(len(light.common), _HELD), light.unit)
    fit.adjust(_STEPS_MOST, clipped=True)
    fit.again()
    fit.weigh(clipped=True)
    fit.adjust(_STEPS_REWEIGHTED, clipped=True)
    return fit.result()


class _Fit:
    """The adjustment.

    Args:
        static, balls: as `fit_lit_balls`.
        common: what the balls have in common, to begin with (`CommonLight.common`).
        spread: standard deviations of that.
        unit: grey value of the balls; None: that of the brightest pixels of these.
    """

    def __init__(
        self,
        static: Sequence[StaticImage],
        balls: SightedBalls,
        common: Floats,
        spread: Floats,
        unit: float | None = None,
    ) -> None:
        self._static, self._balls = static, balls
        self.state = _State(balls.xy.copy(), common.copy())
        self._windows = self._cut()
        self._model = np.full(len(balls), _MODEL_START)
        brightest, self._contrast = self._brightness()
        self._unit = brightest if unit is None else unit
        self._prior, self._prior_weight = common.copy(), spread**-2

    def release_radius(self) -> None:
        """Estimate the radius from here on; in a light that is not clipped it has no optimum."""
        self._prior_weight[-1] = _RADIUS_SPREAD**-2

    def _cut(self) -> list[Windows]:
        radius = float(np.exp(self.state.common[-1]))
        return list(windows(self._static, self._balls, self.state.xy, radius, _SMALLEST_BLUR))

    def again(self) -> None:
        """Cut the windows where the balls are now."""
        self._windows = self._cut()

    def _brightness(self) -> tuple[float, Floats]:
        """Grey value of the balls, and each one's contrast with its background."""
        level, contrast = np.empty(len(self._balls)), np.empty(len(self._balls))
        for group in self._windows:
            off = np.where(group.used, np.abs(group.grey - group.spheres.background), 0.0).reshape(len(group.index), -1)
            brightest = np.argsort(off, axis=1)[:, -3:]
            contrast[group.index] = np.take_along_axis(off, brightest, axis=1).mean(axis=1)
            level[group.index] = np.take_along_axis(group.grey.reshape(off.shape), brightest, axis=1).mean(axis=1)
        return float(max(np.median(level), 1.0)), np.maximum(contrast, 1.0)

    def _at(self, state: _State, index: Integers) -> Light:
        cameras = len(self._static)
        camera = self._balls.camera[index]
        gain = np.exp(state.common[LIGHT : LIGHT + cameras])[camera]
        blur = np.exp(state.common[LIGHT + cameras : LIGHT + 2 * cameras])[camera]
        return Light(state.xy[index], self._unit * state.common[:LIGHT], gain, blur, float(np.exp(state.common[-1])))

    def _residuals(self, group: Windows, state: _State, clipped: bool) -> tuple[Floats, Floats, Floats]:
        """Model minus image (m, p), derivatives (m, 10, p), variances (m, p), infinite where a pixel does not count."""
        value, design, _ = sphere_images(group.spheres, self._at(state, group.index), clipped=clipped)
        design[:, 2 : 2 + LIGHT] *= self._unit
        full = group.saturated & (value >= FULL - 1)
        variance = group.variance + _ROUNDING + (self._model * self._contrast)[group.index, None, None] ** 2
        variance = np.where(group.used & ~full, variance, np.inf)
        m = len(group.index)
        return (
            np.minimum(value, FULL).reshape(m, -1) - group.grey.reshape(m, -1),
            design.reshape(m, UNKNOWNS, -1),
            variance.reshape(m, -1),
        )

    def _columns(self, index: Integers) -> Integers:
        """(m, 8) places of a ball's common unknowns."""
        cameras = len(self._static)
        camera = self._balls.camera[index][:, None]
        light = np.broadcast_to(np.arange(LIGHT), (len(index), LIGHT))
        last = np.full_like(camera, LIGHT + 2 * cameras)
        return np.concatenate((light, LIGHT + camera, LIGHT + cameras + camera, last), axis=1)

    def _equations(self, state: _State, clipped: bool) -> tuple[float, Floats, Floats]:
        """Cost, normal matrices (n, 10, 10), and right sides (n, 10) of all balls."""
        n = len(self._balls)
        normal, right = np.zeros((n, UNKNOWNS, UNKNOWNS)), np.zeros((n, UNKNOWNS))
        cost = 0.0
        for group in self._windows:
            v, design, variance = self._residuals(group, state, clipped)
            test = np.abs(v) / np.sqrt(variance)
            inner = test <= _HUBER
            cost += float(np.where(inner, test**2, 2 * _HUBER * test - _HUBER**2).sum())
            weight = np.where(inner, 1.0, _HUBER / np.maximum(test, _HUBER)) / variance
            weighted = design * weight[:, None]
            normal[group.index] = weighted @ design.swapaxes(1, 2)
            right[group.index] = -(weighted @ v[:, :, None])[..., 0]
        off = state.common - self._prior
        return cost + float(self._prior_weight @ off**2), normal, right

    def adjust(self, steps: int, *, clipped: bool) -> None:
        """Adjust with the variances as they are."""
        damping = 1e-3
        cost, normal, right = self._equations(self.state, clipped)
        for _ in range(steps):
            local, common = self._step(normal, right, damping)
            far = np.linalg.norm(local, axis=1)
            local *= np.minimum(1.0, _FARTHEST / np.maximum(far, 1e-12))[:, None]
            tried = _State(self.state.xy + local, self.state.common + np.clip(common, -0.7, 0.7))
            new = self._equations(tried, clipped)
            if new[0] < cost:
                gained = cost - new[0]
                self.state, (cost, normal, right) = tried, new
                damping = max(damping / 10, 1e-9)
                if np.median(far) < _SETTLED_PX and gained < 1e-4 * cost:
                    break
            else:
                damping *= 10
                if damping > 1e4:
                    break

    def _step(self, normal: Floats, right: Floats, damping: float) -> tuple[Floats, Floats]:
        """Steps of the centres (n, 2) and of the common unknowns."""
        size = len(self.state.common)
        full, vector = np.diag(self._prior_weight), -self._prior_weight * (self.state.common - self._prior)
        local = normal[:, :2, :2] * (1 + damping * np.eye(2)) + 1e-9 * np.eye(2)
        inverse = np.linalg.inv(local)
        cross = normal[:, :2, 2:]
        reduced = normal[:, 2:, 2:] - cross.swapaxes(1, 2) @ inverse @ cross
        reduced_right = right[:, 2:] - (cross.swapaxes(1, 2) @ inverse @ right[:, :2, None])[..., 0]
        columns = self._columns(np.arange(len(self._balls)))
        np.add.at(full, (columns[:, :, None], columns[:, None, :]), reduced)
        np.add.at(vector, columns, reduced_right)
        full[np.diag_indices(size)] *= 1 + damping
        self._cofactors = full
        common = np.linalg.solve(full, vector)
        step = (inverse @ (right[:, :2] - (cross @ common[columns][..., None])[..., 0])[..., None])[..., 0]
        return np.asarray(step, float), np.asarray(common, float)

    def weigh(self, *, clipped: bool) -> None:
        """Estimate the model's error of each ball from its residuals; little is known of one alone.

        Residuals that are alike on both sides of the centre (blur, size, the other half of an ellipse) do not move it:
        their odd part alone counts.
        """
        excess, count = np.zeros(len(self._balls)), np.zeros(len(self._balls))
        for group in self._windows:
            v, _, variance = self._residuals(group, self.state, clipped)
            counts = np.isfinite(variance)
            counts &= counts[:, ::-1]  # the window turned by half a circle
            odd = v - v[:, ::-1]
            noise = (group.variance + _ROUNDING).reshape(v.shape)
            squares = np.where(counts, odd**2 - noise - noise[:, ::-1], 0.0) / 2
            count[group.index] = counts.sum(axis=1)
            excess[group.index] = squares.sum(axis=1) / np.maximum(count[group.index] - 4, 1)
        own = np.maximum(excess, 0.0) / self._contrast**2
        for camera in range(len(self._static)):
            of = self._balls.camera == camera
            if of.any():
                usual = float(np.median(own[of]))
                own[of] = (count[of] * own[of] + _MODEL_FREEDOM * usual) / (count[of] + _MODEL_FREEDOM)
        self._model = np.sqrt(np.maximum(own, _MODEL_LEAST**2))

    def result(self) -> LitBalls:
        """The measured balls."""
        n = len(self._balls)
        _, normal, right = self._equations(self.state, True)
        self._step(normal, right, 0.0)
        of_common = np.linalg.inv(self._cofactors)
        inverse = np.asarray(np.linalg.inv(normal[:, :2, :2] + 1e-9 * np.eye(2)), float)
        carried = inverse @ normal[:, :2, 2:]
        columns = self._columns(np.arange(n))
        shared = carried @ of_common[columns[:, :, None], columns[:, None, :]] @ carried.swapaxes(1, 2)
        explained = np.empty(n)
        own = np.empty((n, 2, 2))
        for group in self._windows:
            v, design, variance = self._residuals(group, self.state, True)
            weight = 1 / variance
            behind = (group.spheres.background - group.grey).reshape(v.shape)
            explained[group.index] = 1 - (weight * v**2).sum(axis=1) / np.maximum(
                (weight * behind**2).sum(axis=1), 1e-9
            )
            own[group.index] = self._sandwich(group, design[:, :2], variance, inverse[group.index])
        return LitBalls(
            self.state.xy,
            own + shared,
            explained,
            CommonLight(self._unit, self.state.common),
        )

    def _sandwich(self, group: Windows, design: Floats, variance: Floats, inverse: Floats) -> Floats:
        """Covariances (m, 2, 2) of centres for errors of the model that neighbouring pixels have in common."""
        size = group.spheres.size
        pixel = np.arange(size)
        length = np.maximum(
            _CORRELATED_LEAST, _CORRELATED * self._balls.radius_px(float(np.exp(self.state.common[-1])))
        )
        weighted = design / variance[:, None]
        noise = (group.variance + _ROUNDING).reshape(variance.shape)
        middle = (weighted * noise[:, None]) @ weighted.swapaxes(1, 2)
        alike = np.exp(-0.5 * ((pixel[:, None] - pixel) / length[group.index, None, None]) ** 2)
        square = weighted.reshape(len(weighted), 2, size, size)
        spread = (alike[:, None] @ square @ alike[:, None]).reshape(weighted.shape)
        error = (self._model * self._contrast)[group.index] ** 2
        middle += error[:, None, None] * (spread @ weighted.swapaxes(1, 2))
        return np.asarray(inverse @ middle @ inverse)
