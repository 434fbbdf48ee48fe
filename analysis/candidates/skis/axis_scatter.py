"""How well points tell a straight axis, by how they scatter about it: alone, and several neighbours alike.

A print, a boot, a binding, the part of another ski or of a border that is beside a ski puts neighbouring points of its
axis off alike. Such errors do not average out as independent ones do, and the sigmas of the points, each from its own
pixels, do not know them. The residuals of the points do: their covariance is taken as

    f diag(sigma^2) + s^2 exp(-|t_i - t_j| / L),

with L as long as such things are. The factor f and the size s are not estimated as one pair of values, which a dozen
points do not determine (the likeliest s is often 0 although it is not): all pairs are counted by their restricted
likelihood and by how usual they are, and what they say about the axis is averaged.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from rig.arrays import Floats

_THING = 0.15  # of the length of the axis: boot, binding, print and marker are 0.3 to 0.5 m long, a ski 2.6 m
_FACTORS: Final = 2.0 ** np.arange(-2, 6)  # f
_SIZES: Final = np.array((0.0, 0.02, 0.04, 0.08, 0.16, 0.32, 0.64))  # px, s
_USUAL_FACTOR: Final = 2.0  # either way, one standard deviation: sigmas of pixels hold what their model may be off
_USUAL_SIZE: Final = 0.04  # px; half of all are below (Cauchy: some are far larger): 1 % of a ski's width
_UNUSUAL: Final = (np.log(_FACTORS[:, None]) / np.log(_USUAL_FACTOR)) ** 2 + 2 * np.log1p((_SIZES / _USUAL_SIZE) ** 2)


@dataclass(frozen=True, slots=True, eq=False)
class AxisScatter:
    """What points say about the accuracy of their axis.

    Attributes:
        sigma: (k,) px, with which the points as independent ones give the variance of the axis' turn.
        common: px, of a shift that all points share, which is added to that.
    """

    sigma: Floats
    common: float


def axis_scatter(t: Floats, off: Floats, sigma: Floats, length: float) -> AxisScatter:
    """How accurate a straight axis through points is.

    Args:
        t: (k,) px along the axis.
        off: (k,) px across it.
        sigma: (k,) of these, from their own pixels.
        length: px, of what the axis belongs to.
    """
    design = np.column_stack((np.ones(len(t)), t - t.mean())) / sigma[:, None]
    complete, _ = np.linalg.qr(design, mode="complete")
    left = complete[:, 2:]
    alike = np.exp(-np.abs(t[:, None] - t) / (_THING * length))
    size, axes = np.linalg.eigh(left.T @ (alike / np.outer(sigma, sigma)) @ left)
    square = (axes.T @ (left.T @ (off / sigma))) ** 2
    variance = _FACTORS[:, None, None] + _SIZES[:, None] ** 2 * np.maximum(size, 0.0)
    chance = _UNUSUAL + np.log(variance).sum(axis=-1) + (square / variance).sum(axis=-1)
    share = np.exp((chance.min() - chance) / 2)
    share /= share.sum()
    factor, together = float(share.sum(axis=1) @ _FACTORS), float(share.sum(axis=0) @ _SIZES**2)
    # points with small sigmas must not outweigh the others: what is alike in neighbours does not depend on these
    weight = 1 / (factor * sigma**2 + together)
    total = weight.sum()
    place = t - weight @ t / total
    place = place / np.sqrt(weight @ place**2 / total)
    gain = np.stack((weight, weight * place)) / total
    shift, turn = np.diag(gain @ (factor * np.diag(sigma**2) + together * alike) @ gain.T)
    return AxisScatter(np.sqrt(turn * total / weight), float(np.sqrt(max(0.0, shift - turn))))
