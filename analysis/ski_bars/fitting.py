"""Fits both skis of a pulse in all images that show them, from what is expected, and refuses what does not hold."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import chdtri

from analysis.ski_bars.bars import OF_POSE, OF_SHAPE, SKIS, ExpectedBars, Poses
from analysis.ski_bars.estimate import WORST_MODEL, BarFit, Estimate
from analysis.ski_bars.image_lines import REDUNDANCY, ImageLine, image_lines
from analysis.ski_bars.model import POSE, SHAPE, SHOVEL_M, BarModel
from analysis.ski_bars.pixels import SkiView, pixels_around
from rig.arrays import Flags, Floats

_EXPLAINED: Final = 0.7  #: of the differences from the static scene along a ski, at least
_VISIBLE: Final = 0.6  #: of the pixels of a ski, at least
_WORST_PX: Final = 1.0  #: sigma of a line across it, at most
_CONTRADICTION: Final = float(chdtri(REDUNDANCY, 1e-4))  #: one sound image in ten thousand contradicts the others more
#: With width and brightness: noise alone gives more in one image of a million.
_EVIDENCE: Final = float(chdtri(REDUNDANCY + 2, 1e-6))
_FREE: Final = 0.5  #: largest share of a ski's pixels that may show the static scene
_TELLING_CELLS: Final = 12  #: least number of pixels that can tell a ski from the static scene
_FEWEST: Final = 2  #: images that show a ski
_SCENE_SIGMAS: Final = 3.0  # of the noise, within which a pixel shows the static scene
_CORE: Final = 0.8  # of a pixel that a ski covers, so that it shows hardly anything else
_STARTS: Final = 12  # of each ski, beside the expected place
_REACH_SIGMAS, _WIDEST_M = 2.0, 0.15  # beside and beyond the expected skis, that are looked at
_ENDS_M: Final = np.arange(-0.3, 0.35, 0.05)  # from where tail and tip usually are, m
_UNSURE_END_M: Final = 0.1  # from this sigma on, ends are sought


@dataclass(frozen=True, slots=True, eq=False)
class FittedBars:
    """A pair of skis.

    Attributes:
        poses: fitted in all images; of a ski that is not seen, the expected one.
        covariance: (10, 10) of the poses, see `ExpectedBars`; without that of the cameras.
        shape: (2, 3) bend, tail and tip, m.
        shape_sigma: (2, 3) m.
        lines: by camera, of both skis; None where it does not show one well.
        seen: (2,) which skis two images or more show.
        distance: chi-squared of the fitted poses against the expected ones.
    """

    poses: Poses
    covariance: Floats
    shape: Floats
    shape_sigma: Floats
    lines: Mapping[str, Sequence[ImageLine | None]]
    seen: tuple[bool, bool]
    distance: float


def fit_bars(
    views: Sequence[SkiView],
    expected: ExpectedBars,
    present: tuple[bool, bool] = (True, True),
    *,
    near: bool = False,
    drawn: bool = False,
) -> FittedBars:
    """Fit a pair of skis.

    Args:
        views: images of one pulse.
        expected: where the skis should be, and how they are shaped.
        present: which skis there are; the pose of the other one stays as expected.
        drawn: a person has drawn them: they are there.
        near: the expected poses are near enough to start from; no other places and ends are tried.
    """
    wide = min(_WIDEST_M, _REACH_SIGMAS * float(np.sqrt(np.diagonal(expected.covariance)[[2, 7]].max())))
    ends = expected.shape[:, 1:] + _REACH_SIGMAS * expected.shape_sigma[:, 1:] * (-1, 1)
    pixels = pixels_around(views, expected.poses, ends, wide)
    fit = BarFit(BarModel(views, expected.poses, present), pixels, expected, drawn=drawn)
    found = fit.solved(fit.start(np.zeros(POSE.stop)))
    if not near and expected.shape_sigma[:, 1:].max() > _UNSURE_END_M:
        found = fit.solved(_with_ends(fit, found.x))
    lines = image_lines(fit, found)
    good = _good(lines)
    if not near and (good.sum(axis=0) < np.where(present, _FEWEST, 0)).any():
        tried = fit.solved(_other_start(fit, expected))
        if tried.cost < found.cost:
            found, lines = tried, image_lines(fit, tried)
            good = _good(lines)
    return _judged(fit, found, good, lines)


def _judged(fit: BarFit, found: Estimate, good: Flags, lines: list[list[ImageLine | None]]) -> FittedBars:
    """The fit after another one without the refused images."""
    if found.model_error >= WORST_MODEL:
        good[:] = False
    if (good != fit.used).any():
        fit.used = good & (good.sum(axis=0) >= _FEWEST)
        if fit.used.any():
            found = fit.solved(found.x, found.model_error)
            lines = image_lines(fit, found)
            good = _good(lines) & (found.model_error < WORST_MODEL)
            fit.used = good & (good.sum(axis=0) >= _FEWEST)
    kept = {
        view.camera.name: [line if fit.used[c, k] else None for k, line in enumerate(lines[c])]
        for c, view in enumerate(fit.model.views)
    }
    covariance = fit.covariance(found)
    step = found.x[POSE] - fit.mean[POSE]
    seen = fit.used.sum(axis=0) >= _FEWEST
    if not fit.drawn:
        seen &= ~_free(fit, found)
    return FittedBars(
        fit.model.poses(found.x),
        covariance[POSE, POSE],
        found.x[SHAPE].reshape(SKIS, OF_SHAPE),
        np.sqrt(np.diagonal(covariance)[SHAPE]).reshape(SKIS, OF_SHAPE),
        kept,
        (bool(seen[0]), bool(seen[1])),
        float(step @ fit.prior[POSE, POSE] @ step),
    )


def _good(lines: list[list[ImageLine | None]]) -> Flags:
    """(m, 2) which lines hold."""
    return np.array(
        [
            [
                line is not None
                and line.explained > _EXPLAINED
                and line.visible > _VISIBLE
                and line.evidence > _EVIDENCE
                and line.sigma < _WORST_PX
                and line.contradiction < _CONTRADICTION
                for line in of
            ]
            for of in lines
        ]
    )


def _free(fit: BarFit, found: Estimate) -> Flags:
    """(2,) which skis cannot be there: an image shows the static scene where they would hide it.

    An image that does not show a ski may be left out: something hides the ski, or the scene is as bright. Where the
    scene itself is seen, and another grey than that of the ski, there is no ski.
    """
    pixels, seen = fit.pixels, found.seen
    bright = found.x[fit.model.unknowns.brightness]
    sigma = np.sqrt(pixels.noise)
    scene = np.abs(pixels.grey - pixels.behind) < _SCENE_SIGMAS * sigma
    free = np.zeros(SKIS, bool)
    alone = ~fit.hidden(found.x)
    for k in np.flatnonzero(fit.used.any(axis=0)).tolist():
        contrast = np.abs(bright[fit.used[:, k], k, None] - pixels.behind).min(axis=0)
        telling = alone & (seen.cover[k] > _CORE) & (seen.cover[1 - k] < 1 - _CORE) & (seen.s[k] < SHOVEL_M)
        telling &= contrast > 2 * _SCENE_SIGMAS * sigma
        for c in np.flatnonzero(~fit.used[:, k]).tolist():
            own = telling & (pixels.camera == c)
            free[k] |= own.sum() >= _TELLING_CELLS and scene[own].mean() > _FREE
    return free


def _other_start(fit: BarFit, expected: ExpectedBars) -> Floats:
    """The best of several starts around the expected place, ski by ski."""
    root = np.linalg.cholesky(expected.covariance)
    draws = np.random.default_rng(1).normal(size=(_STARTS, SKIS * OF_POSE)) @ root.T
    best = np.zeros(SKIS * OF_POSE)
    cost = fit.cost(fit.start(best))
    for k in np.flatnonzero(fit.model.present).tolist():
        own = slice(OF_POSE * k, OF_POSE * (k + 1))
        for draw in draws:
            tried = best.copy()
            tried[own] = draw[own]
            less = fit.cost(fit.start(tried))
            if less < cost:
                best, cost = tried, less
    return fit.start(best)


def _with_ends(fit: BarFit, x: Floats) -> Floats:
    """Unknowns with tails and tips where the images show them."""
    for k in np.flatnonzero(fit.model.present).tolist():
        for end in (1, 2):
            at = SHAPE.start + OF_SHAPE * k + end
            tries = [np.concatenate((x[:at], [fit.mean[at] + off], x[at + 1 :])) for off in _ENDS_M]
            x = min(tries, key=fit.cost)
    return x
