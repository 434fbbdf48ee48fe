"""Least squares of the unknowns of a pair of skis, robust against what is no ski, with honest covariances.

The variance of a pixel is that of its noise and that of the model, whose error is in proportion to the contrast C,

    variance = noise^2 + (m C)^2,

with m from the residuals. Errors of the model are alike in neighbouring pixels: their correlation is
exp(-|dt| / 10 px - |du| / 1.5 px) along and across a ski. The fit weighs pixels as if that many were one, and its
covariance is a sandwich of the normal equations and the true covariance of the pixels. Pixels that show something else
(a leg, a flag, the other boot) lose their weight (Geman and McClure).
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from analysis.ski_bars.bars import SKIS, ExpectedBars
from analysis.ski_bars.model import POSE, SHAPE, SHOVEL_M, BarModel, Predicted, hidden_by_boots
from analysis.ski_bars.pixels import CELL_PX, Pixels
from rig.arrays import Flags, Floats, Reals

_ALONG_PX, _ACROSS_PX = 10.0, 1.5  # over which errors of the model are alike
_TOGETHER: Final = 2 * _ALONG_PX * 2 * _ACROSS_PX / CELL_PX  # cells with one error
_MODEL, _LEAST_MODEL = 0.1, 0.02  # m before the residuals tell it, and at least
#: A larger m means that the pixels show something else than skis.
WORST_MODEL: Final = 0.2
_SHOVEL: Final = 0.3  #: m of the shovel, whose form is not that of the model
_SIGMAS = 3.0  # residuals that count a quarter
_MAD_TO_SIGMA = 1.4826
_TAILS = 1.25  # factor of m in covariances, for the tails of its errors, which the median leaves out
_BESIDE_PX = 2.0  # distance beside a ski within which pixels are used to estimate m
_ITERATIONS: Final = 20
_ENOUGH, _NEAR = 0.05, 0.8  # of a standard deviation: steps that end the iteration at last, and those before
_DAMPED, _DAMPED_MORE = 1e-3, 0.1  # at first, and at least where a step has made the sum larger
_BLUR_PX, _BLUR_LOG = 0.65, 0.25
_HALF_M, _HALF_LOG = 0.035, 0.4  # half the width that a ski shows, and its spread
_GREY_SIGMA = 100.0
_COVERED = 0.05  # of a pixel by a ski
_ON_AXIS_PX = 0.5  # rows of cells are 1 px apart


@dataclass(frozen=True, slots=True, eq=False)
class Estimate:
    """A fitted pair of skis.

    Attributes:
        x: unknowns, as `model.Unknowns` orders them.
        seen: what they show, with its derivatives.
        cost: half the robust sum of squares, with that of the expectation.
        model_error: m.
    """

    x: Floats
    seen: Predicted
    cost: float
    model_error: float


class BarFit:
    """The pixels of a pulse, the model, and what was expected.

    Args:
        model: of the images.
        pixels: around the skis.
        expected: before.
        drawn: whether a person says that there are skis.

    Attributes:
        used: (m, 2) which skis count in which images.
    """

    def __init__(self, model: BarModel, pixels: Pixels, expected: ExpectedBars, *, drawn: bool = False) -> None:
        self.model, self.pixels, self.drawn = model, pixels, drawn
        self.used = np.tile(np.array(model.present), (len(model.views), 1))
        self._hidden: tuple[Floats, Flags] | None = None  # by boots, at the latest poses
        at = model.unknowns
        self.mean, sigma = np.zeros(at.size), np.empty(at.size)
        self.mean[SHAPE], sigma[SHAPE] = expected.shape.ravel(), expected.shape_sigma.ravel()
        self.mean[at.blur], sigma[at.blur] = np.log(_BLUR_PX), _BLUR_LOG
        self.mean[at.width], sigma[at.width] = np.log(_HALF_M), _HALF_LOG
        sigma[at.brightness] = _GREY_SIGMA
        self.prior = np.zeros((at.size, at.size))
        self.prior[POSE, POSE] = np.linalg.inv(expected.covariance)
        rest = slice(POSE.stop, None)
        self.prior[rest, rest] = np.diag(sigma[rest] ** -2.0)

    def start(self, shift: Floats) -> Floats:
        """Unknowns to start from, with the poses shifted by steps (10,); the brightness is that along the axes."""
        at, x = self.model.unknowns, self.mean.copy()
        x[POSE] = shift
        seen = self.model.predicted(self.pixels, x, derivatives=False)
        bare = ~self.hidden(x)
        for c in range(len(self.model.views)):
            here = bare & (self.pixels.camera == c)
            for k in range(SKIS):
                core = here & (np.abs(seen.u[k]) < _ON_AXIS_PX) & (seen.cover[k] > 0.5)
                if core.any():
                    x[at.brightness[c, k]] = np.median(self.pixels.grey[core])
        return x

    def cost(self, x: Floats, model_error: float = _MODEL) -> float:
        """Half the robust sum of squares at unknowns."""
        return self._cost(x, self.model.predicted(self.pixels, x, derivatives=False), model_error)

    def solved(self, x: Floats, model_error: float | None = None) -> Estimate:
        """The minimum near a start: Gauss-Newton with damping.

        Args:
            x: unknowns to start from.
            model_error: m there; None: it is not known, so it is estimated near the minimum first.
        """
        if model_error is None:
            x, seen, _ = self._minimum(x, _MODEL, _NEAR)
            model_error = self._model_error(x, seen)
        x, seen, cost = self._minimum(x, model_error, _ENOUGH)
        return Estimate(x, seen, cost, self._model_error(x, seen))

    def _minimum(self, x: Floats, m: float, enough: float) -> tuple[Floats, Predicted, float]:
        """Unknowns at the minimum, what they show, and the cost; a step of `enough` standard deviations ends it."""
        damping = _DAMPED
        seen = self.model.predicted(self.pixels, x)
        fitted = self.fitted(x, seen)
        cost = self._cost(x, seen, m, fitted)
        for _ in range(_ITERATIONS):
            weight = self.weights(x, seen, fitted, m)
            normal = (seen.by_unknowns * weight) @ seen.by_unknowns.T + self.prior
            off = self.pixels.grey - seen.grey
            right = seen.by_unknowns @ (weight * off) - self.prior @ self._from_mean(x)
            while True:
                step = np.linalg.solve(normal + damping * np.diag(np.diagonal(normal)), right)
                tried = self.model.predicted(self.pixels, x + step)
                less = self._cost(x + step, tried, m, fitted)
                small = step @ normal @ step < enough**2
                if less <= cost or small:
                    break
                damping = max(10 * damping, _DAMPED_MORE)
            if less <= cost:
                x, seen, damping, cost = x + step, tried, damping / 10, less
            if small:
                break
        return x, seen, cost

    def _from_mean(self, x: Floats) -> Floats:
        return np.asarray(x - self.mean)

    def _cost(self, x: Floats, seen: Predicted, m: float, fitted: Flags | None = None) -> float:
        off = self._from_mean(x)
        model = self._model_variance(x, seen, m)
        square = (self.pixels.grey - seen.grey) ** 2 / (self.pixels.noise + model)
        share = (self.pixels.noise + model) / (self.pixels.noise + _TOGETHER * model)
        loss = share * square * _SIGMAS**2 / (square + _SIGMAS**2)
        return (
            float(loss[self.fitted(x, seen) if fitted is None else fitted].sum(dtype=float) + off @ self.prior @ off)
            / 2
        )

    def _contrast(self, x: Floats) -> Reals:
        """(n,) of the ski that differs more from the static scene there."""
        bright = x[self.model.unknowns.brightness].T.astype(np.float32)
        off = np.zeros_like(self.pixels.behind)
        for k in np.flatnonzero(self.model.present):
            np.maximum(off, np.abs(bright[k].take(self.pixels.camera) - self.pixels.behind), out=off)
        return off

    def _model_variance(self, x: Floats, seen: Predicted, m: float) -> Reals:
        shovel = ((seen.s > SHOVEL_M) & np.isfinite(seen.s)).any(axis=0)
        error = np.where(shovel, np.float32(np.hypot(m, _SHOVEL)), np.float32(m)) * self._contrast(x)
        return np.asarray(error * error)

    def robust(self, x: Floats, seen: Predicted, m: float) -> Reals:
        """(n,) weights of the pixels: 1 where the model holds, else towards 0."""
        return self._robust(seen, self._model_variance(x, seen, m))

    def _robust(self, seen: Predicted, model: Reals) -> Reals:
        square = (self.pixels.grey - seen.grey) ** 2 / (self.pixels.noise + model)
        return np.asarray((_SIGMAS**2 / (square + _SIGMAS**2)) ** 2)

    def weights(self, x: Floats, seen: Predicted, fitted: Flags, m: float) -> Reals:
        """(n,) weights in the normal equations: errors that neighbours share count once."""
        model = self._model_variance(x, seen, m)
        return np.asarray(fitted * self._robust(seen, model) / (self.pixels.noise + _TOGETHER * model))

    def fitted(self, x: Floats, seen: Predicted) -> Flags:
        """(n,) which pixels count: those of used images that no boot may hide."""
        nearest = np.abs(seen.u).argmin(axis=0)
        return np.asarray(self.used[self.pixels.camera, nearest] & ~self.hidden(x))

    def hidden(self, x: Floats) -> Flags:
        """(n,) which pixels boots and bindings may hide; those of the latest poses are kept."""
        if self._hidden is None or (self._hidden[0] != x[POSE]).any():
            self._hidden = x[POSE].copy(), hidden_by_boots(self.model, x, self.pixels)
        return self._hidden[1]

    def _model_error(self, x: Floats, seen: Predicted) -> float:
        near = ((np.abs(seen.u) < seen.half + _BESIDE_PX) & (seen.s < SHOVEL_M)).any(axis=0) & self.fitted(x, seen)
        near &= (seen.cover > _COVERED).any(axis=0)
        if not near.any():
            return _MODEL
        off = np.abs(self.pixels.grey - seen.grey)[near]
        excess = (_MAD_TO_SIGMA * off) ** 2 - self.pixels.noise[near]
        ratio = np.median(excess / np.maximum(self._contrast(x)[near], 1.0) ** 2)
        return float(np.sqrt(np.clip(ratio, _LEAST_MODEL**2, WORST_MODEL**2)))

    def covariance(self, found: Estimate) -> Floats:
        """Covariance of the unknowns: the sandwich of normal equations and covariance of the pixels."""
        x, seen, m = found.x, found.seen, found.model_error
        fitted = self.fitted(x, seen)
        normal, by_noise, by_model = self.sandwich(x, seen, seen.by_unknowns, fitted, m)
        inverse = np.linalg.inv(normal + self.prior)
        return np.asarray(inverse @ (by_noise + by_model + self.prior) @ inverse)

    def sandwich(
        self, x: Floats, seen: Predicted, rows: Reals, fitted: Flags, m: float
    ) -> tuple[Floats, Floats, Floats]:
        """Normal equations of the pixels, and the covariances of their right side by noise and by errors of the model.

        Args:
            x: unknowns.
            seen: at these.
            rows: (k, n) derivatives.
            fitted: (n,) pixels that count.
            m: error of the model in proportion to the contrast.
        """
        weight = self.weights(x, seen, fitted, m)
        rows = rows.astype(float)  # what is inverted loses digits
        weighted = weight * rows
        by_noise, by_model = (weighted * self.pixels.noise) @ weighted.T, np.zeros((len(rows),) * 2)
        error = (_TAILS * np.sqrt(self._model_variance(x, seen, m)) * weighted).astype(np.float32)
        nearest = np.where(error.any(axis=0), np.abs(seen.u).argmin(axis=0), SKIS)
        for here in self.pixels.of_cameras(len(self.model.views)):
            for k in np.flatnonzero(self.model.present).tolist():
                own = here.start + np.flatnonzero(nearest[here] == k)
                alike = np.exp(-_apart(seen.t[k, own] / _ALONG_PX) - _apart(seen.u[k, own] / _ACROSS_PX))
                by_model += (error[:, own] @ alike) @ error[:, own].T
        return np.asarray(rows @ weighted.T), np.asarray(by_noise), by_model


def _apart(place: Reals) -> Reals:
    return np.asarray(np.abs(place[:, None] - place))
