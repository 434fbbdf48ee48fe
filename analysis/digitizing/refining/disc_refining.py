"""Refines a click on a disc to its centre."""

from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from analysis.digitizing.refining.fit_judgement import (
    MODEL,
    NEAR_PX,
    NOISE,
    TRIED,
    inside,
    is_poor,
    is_significant,
    noise_around,
    part_around,
    poor,
)
from analysis.scene.disc import MARGIN, Disc, fit_discs
from rig.arrays import Floats
from rig.errors import NoFitError
from rig.images.picture import Grey
from rig.phrase import Phrase, phrase

_SCALES = 0.8 * 1.4 ** np.arange(11)  # px; a disc of radius R answers most at R / sqrt(2)
_STRETCH = 0.75  # log of the ratio of the axes: a disc seen from the side, or smeared by its motion
_UNKNOWNS = 10
_MORE_THAN_NONE = 7  # of them that a plane does not have
_NOT_ROUND_DARK: Final = phrase("hand_none_round_dark", "nothing round and dark")
_NOT_ROUND_BRIGHT: Final = phrase("hand_none_round_bright", "nothing round and bright")
_NOT_DARK: Final = phrase("hand_not_dark", "what is there is not dark")
_NOT_BRIGHT: Final = phrase("hand_not_bright", "what is there is not bright")
_FARTHER: Final = phrase("hand_disc_farther", "the nearest one is farther than the click")
_LONG: Final = phrase("hand_disc_long", "what is there is long, not round")


@dataclass(frozen=True, slots=True, eq=False)
class RefinedDisc:
    """The centre of a disc.

    Attributes:
        xy: (2,) px.
        sigma: (2,) standard deviations of x and y, px.
        covariance: (2, 2) px^2.
        radius: px.
    """

    xy: Floats
    sigma: Floats
    covariance: Floats
    radius: float


def refine_disc(image: Grey, xy: Floats, *, dark: bool = False) -> RefinedDisc:
    """The disc at a click.

    Args:
        image: (rows, columns) grey values.
        xy: (2,) the click, px: on the disc, or at most `NEAR_PX` beside it.
        dark: the disc is darker than what is around it.

    Raises:
        NoFitError: there is no such disc; the message says why.
    """
    xy = inside(image, xy)
    noise = noise_around(image, xy)
    places, radii = _blobs(image, xy, dark)
    if not len(places):
        raise _refusal(_NOT_ROUND_DARK if dark else _NOT_ROUND_BRIGHT)
    sigma = np.full(image.shape, noise)
    fitted = fit_discs(np.asarray(image, float), sigma, places, radii)
    reasons = [_why_no_disc(disc, xy, dark, noise) for disc in fitted]
    sound = [disc for disc, reason in zip(fitted, reasons, strict=True) if disc is not None and reason is None]
    if not sound:
        raise _refusal(next(reason for reason in reasons if reason is not None))
    best = min(sound, key=lambda disc: float(np.hypot(*(disc.xy - xy))) / (disc.radius + NEAR_PX))
    return RefinedDisc(best.xy, best.sigma, best.covariance, best.radius)


def _refusal(why: Phrase) -> NoFitError:
    text = "no disc here: {why}; click nearer to its centre, or measure by hand"
    return NoFitError(phrase("hand_no_disc", text, why=why))


def _blobs(image: Grey, xy: Floats, dark: bool) -> tuple[Floats, Floats]:
    """Places (n, 2) and radii (n,) of round blobs that the click is on, or near, the strongest answers first."""
    part, corner = part_around(image, xy, 2 * _SCALES[-1] + NEAR_PX + MARGIN)
    grey = np.asarray(part, np.float32) * (-1 if dark else 1)
    smooth = (cv2.GaussianBlur(grey, (0, 0), float(scale), borderType=cv2.BORDER_REPLICATE) for scale in _SCALES)
    answers = np.stack([-(scale**2) * cv2.Laplacian(s, cv2.CV_32F) for scale, s in zip(_SCALES, smooth, strict=True)])
    largest = np.stack([cv2.dilate(layer, np.ones((3, 3), np.uint8)) for layer in answers])
    around = largest.copy()
    around[1:] = np.maximum(around[1:], largest[:-1])
    around[:-1] = np.maximum(around[:-1], largest[1:])
    inner = np.zeros(answers.shape, bool)
    inner[:-1, 1:-1, 1:-1] = True
    layer, row, column = np.nonzero((answers >= around) & (answers > 0) & inner)
    places, radii = np.column_stack((column, row)) + corner, np.sqrt(2) * _SCALES[layer]
    near = np.hypot(*(places - xy).T) <= radii + NEAR_PX
    order = np.argsort(-answers[layer, row, column][near])[:TRIED]
    return places[near][order], radii[near][order]


def _why_no_disc(disc: Disc | None, xy: Floats, dark: bool, noise: float) -> Phrase | None:
    """What speaks against a fitted disc, None: nothing."""
    if disc is None:
        return phrase("hand_disc_not_converged", "the fit does not converge, or the image ends")
    pixels = np.pi * (disc.radius + MARGIN) ** 2
    expected = noise**2 + (MODEL * disc.contrast) ** 2
    explained = disc.contrast**2 * np.pi * max(disc.radius, disc.blur) ** 2 / disc.rms**2
    ratio = disc.rms / np.sqrt(expected)
    against = (
        ((disc.contrast < 0) != dark, _NOT_DARK if dark else _NOT_BRIGHT),
        (np.hypot(*(disc.xy - xy)) > disc.radius + NEAR_PX, _FARTHER),
        (disc.stretch > _STRETCH, _LONG),
        (not is_significant(explained, _MORE_THAN_NONE), NOISE),
        (
            is_poor(pixels * ratio**2, pixels - _UNKNOWNS),
            poor(float(ratio)),
        ),
    )
    return next((reason for speaks, reason in against if speaks), None)
