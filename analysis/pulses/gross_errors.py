"""Adjusts points and skis although some images are wrong: finds the wrong image, or says that it cannot be found.

An image is left out only if the data show that it is the wrong one: without it the residuals are in order, and without
any other one they are not. Three rays do not always show that (an error along an epipolar line fits another ray), and
three image lines of one ski never do; then the object is given up instead of being wrong. Interchanged skis are an
exception: interchanging them back in the right image, and in no other, makes both skis fit.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import special

from analysis.pulses.least_squares import Adjusted, Condition, Objects, adjust
from analysis.pulses.skis import SkiLines
from rig.arrays import Flags, Floats, Integers

#: Probability that sound measurements of an object are held for wrong.
RISK = 0.001
#: By how much the chi-square of the second best explanation must exceed that of the best: one degree of freedom.
MARGIN = float(special.chdtri(1, RISK))


@dataclass(frozen=True, slots=True, eq=False)
class Checked:
    """n objects, adjusted from the images that are in order.

    Attributes:
        adjusted: with the condition IMPOSSIBLE where an error was found, but not the wrong image.
        used: (n, m) images that the result rests on.
        removed: (n, m) images that were left out; all of an object where the wrong one could not be found.
        residual: (n, m) px; of removed images before they were removed. NaN where there is no result.
        w: (n, m) test values; likewise.
    """

    adjusted: Adjusted
    used: Flags
    removed: Flags
    residual: Floats
    w: Floats


def check_points(points: Objects, adjusted: Adjusted, calibration: Floats) -> Checked:
    """Leave out wrong images, where the data show which they are.

    Args:
        points: n objects of any kind.
        adjusted: from all images.
        calibration: (p, p) covariance of the cameras' uncertain parameters.
    """
    nothing = np.zeros_like(points.seen)
    return _located(points, calibration, adjusted, nothing, nothing[:, 0])


def check_skis(skis: SkiLines, adjusted: Adjusted, calibration: Floats) -> Checked:
    """Leave out images with right and left interchanged, and other wrong images.

    Args:
        skis: n skis, right and left in turn.
        adjusted: from all images.
        calibration: (p, p) covariance of the cameras' uncertain parameters.
    """
    return _located(skis, calibration, adjusted, *_interchanged(skis, calibration, adjusted))


def _located(objects: Objects, calibration: Floats, first: Adjusted, removed: Flags, lost: Flags) -> Checked:
    """The results without the images `removed` (n, m) and the objects `lost` (n,), and without what else is wrong."""
    residual, w = first.residual.copy(), first.w.copy()
    keep, lost = objects.seen & ~removed, lost.copy()
    adjusted = _replaced(first, np.flatnonzero(removed.any(axis=1)), objects, calibration, keep)
    open_ = _wrong(adjusted) & ~lost
    while open_.any():
        rows = np.flatnonzero(open_)
        image = _wrong_image(objects, calibration, keep, rows)
        found, image = rows[image >= 0], image[image >= 0]
        lost |= open_
        lost[found] = False
        keep[found, image] = False
        adjusted = _replaced(adjusted, found, objects, calibration, keep)
        open_ = _wrong(adjusted) & ~lost
    condition = adjusted.condition.copy()
    condition[lost] = Condition.IMPOSSIBLE
    keep[lost] = False
    nothing = (~adjusted.ok & ~lost)[:, None]
    residual, w = (
        np.where(nothing, np.nan, np.where(keep, new, old))
        for new, old in ((adjusted.residual, residual), (adjusted.w, w))
    )
    return Checked(replace(adjusted, condition=condition), keep, objects.seen & ~keep, residual, w)


def _wrong(adjusted: Adjusted) -> Flags:
    """Objects whose images contradict each other."""
    controlled = adjusted.redundancy > 0
    bad = adjusted.chi_square > special.chdtri(np.maximum(adjusted.redundancy, 1), RISK)
    return np.asarray(controlled & (bad | (adjusted.condition == Condition.IMPOSSIBLE)))


def _wrong_image(objects: Objects, calibration: Floats, keep: Flags, rows: Integers) -> NDArray[np.int_]:
    """The one image of each object without which the others agree best; -1 where another explains it as well."""
    m = keep.shape[1]
    without = np.repeat(keep[rows], m, axis=0) & ~np.tile(np.eye(m, dtype=bool), (len(rows), 1))
    trial = adjust(objects.subset(np.repeat(rows, m)), calibration, without)
    chi = _explanation(trial).reshape(len(rows), m)
    chi[~keep[rows]] = np.inf
    return _clear_best(chi)


def _explanation(trial: Adjusted) -> Floats:
    """How badly the images agree; 0 where that cannot be judged, infinite where they contradict the geometry."""
    chi = np.where(trial.redundancy > 0, trial.chi_square, 0.0)
    return np.select([trial.ok, trial.condition == Condition.IMPOSSIBLE], [chi, np.inf], 0.0)


def _clear_best(chi: Floats) -> NDArray[np.int_]:
    """(n,) the column with the least value, -1 where the second least is not clearly larger."""
    order = np.sort(chi, axis=1)
    return np.where(order[:, 0] + MARGIN < order[:, 1], chi.argmin(axis=1), -1)


def _interchanged(skis: SkiLines, calibration: Floats, first: Adjusted) -> tuple[Flags, Flags]:
    """Images (n, m) with right and left ski interchanged, and skis (n,) for which this image cannot be found."""
    n, m = skis.seen.shape
    found, unclear = np.zeros((n, m), bool), np.zeros(n, bool)
    both = skis.seen & skis.seen[np.arange(n) ^ 1]
    suspect = _wrong(first).reshape(-1, 2).any(axis=1) & (both.sum(axis=1)[::2] > 2)
    pairs = np.flatnonzero(np.repeat(suspect, 2)).reshape(-1, 2)
    if not len(pairs):
        return found, unclear
    those, chi = skis.subset(pairs.ravel()), np.full((len(pairs), m), np.inf)
    for image in range(m):
        trial = adjust(those.interchanged(image), calibration)
        explained = np.where(_wrong(trial), np.inf, _explanation(trial)).reshape(-1, 2).sum(axis=1)
        chi[:, image] = np.where(both[pairs[:, 0], image], explained, np.inf)
    best, fits = _clear_best(chi), np.isfinite(chi).any(axis=1)
    clear = fits & (best >= 0)
    found[pairs[clear], best[clear, None]] = True
    unclear[pairs[fits & (best < 0)]] = True
    return found, unclear


def _replaced(adjusted: Adjusted, rows: Integers, objects: Objects, calibration: Floats, keep: Flags) -> Adjusted:
    """The results with the objects `rows` adjusted anew from the images `keep`."""
    if not len(rows):
        return adjusted
    anew = adjust(objects.subset(rows), calibration, keep[rows])
    changed = {}
    for name in Adjusted.__slots__:
        values = getattr(adjusted, name).copy()
        values[rows] = getattr(anew, name)
        changed[name] = values
    return Adjusted(**changed)
