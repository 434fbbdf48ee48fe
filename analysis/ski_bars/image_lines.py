"""The lines of single images, for skis that were fitted in all images together.

The measurements of a pulse (`svev-measurements/1`) hold each image by itself, and its errors are taken to be
independent of those of the other images. So the common fit is not projected into the images. From there on, each image
alone takes one more step of its own: a shift across each ski, a turn and a shift along, beside its own blur, widths and
brightness.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from analysis.ski_bars.bars import SKIS, Poses
from analysis.ski_bars.estimate import BarFit, Estimate
from analysis.ski_bars.model import SHOVEL_M
from analysis.ski_bars.pixels import SkiView
from rig.arrays import Floats

REDUNDANCY: Final = 3  #: what an image says of a ski: shift across, px, turn, rad, and shift along, px
_S: Final = np.linspace(-1.1, 1.1, 12)  # m, where the axis is projected
_WIDE_PX, _WIDE_RAD = 3.0, 0.2  # of the step of an image by itself: it begins at the common fit
_BESIDE_PX = 1.5  # beside a ski, whose pixels it has to explain
_COVERED = 0.05


@dataclass(frozen=True, slots=True, eq=False)
class ImageLine:
    """A ski in one image.

    Attributes:
        xy: (2, 2) px, two points of the line that fits its axis best; their errors are independent.
        sigma: standard deviation of each across the line, px.
        lasting: px, the part of a shift and of a turn that errors of the model make: they are alike in the next images.
        binding: (2,) px, where the binding is on the axis.
        binding_covariance: (2, 2) px^2.
        explained: share of the differences from scene and other ski, along the ski, that the model explains.
        visible: share of the ski's pixels that nothing else hides.
        evidence: by how much the ski, beside the other one, lessens the sum of squares of residuals over noise.
        contradiction: chi-squared of what the image says by itself against all images, redundancy `REDUNDANCY`.
    """

    xy: Floats
    sigma: float
    lasting: float
    binding: Floats
    binding_covariance: Floats
    explained: float
    visible: float
    evidence: float
    contradiction: float


def image_lines(fit: BarFit, found: Estimate) -> list[list[ImageLine | None]]:
    """The lines of both skis in each image; None where an image does not show a ski."""
    x, seen, m = found.x, found.seen, found.model_error
    model, at = fit.model, fit.model.unknowns
    fitted = fit.fitted(x, seen)
    off = fit.pixels.grey - seen.grey
    weight, robust = fit.weights(x, seen, fitted, m), fit.robust(x, seen, m)
    poses = model.poses(x)
    lines: list[list[ImageLine | None]] = []
    for c, view in enumerate(model.views):
        rows = np.zeros((SKIS * REDUNDANCY, len(off)), np.float32)
        here = fitted & (fit.pixels.camera == c)
        for k in range(SKIS):
            t = np.where(np.isfinite(seen.t[k]), seen.t[k], 0.0)
            rows[REDUNDANCY * k : REDUNDANCY * (k + 1)] = -seen.by_u[k], -seen.by_u[k] * t, -seen.by_t[k]
        of_image = np.concatenate(([at.blur[c]], at.width[c], at.brightness[c]))
        rows = np.where(here, np.concatenate((rows, seen.by_unknowns[of_image])), np.float32(0))
        prior = np.zeros((len(rows),) * 2)
        own = np.tile((_WIDE_PX, _WIDE_RAD, _WIDE_PX), SKIS) ** -2.0
        prior[: len(own), : len(own)] = np.diag(own)
        prior[len(own) :, len(own) :] = fit.prior[np.ix_(of_image, of_image)]
        normal, by_noise, middle = fit.sandwich(x, seen, rows, here, m)
        inverse = np.linalg.inv(normal + prior)
        by_model = inverse @ middle @ inverse
        step = inverse @ (rows @ (weight * off))
        covariance = inverse @ (by_noise + prior) @ inverse + by_model
        of: list[ImageLine | None] = []
        for k in range(SKIS):
            near = here & (np.abs(seen.u[k]) < seen.half[k] + _BESIDE_PX)
            near &= (seen.cover[k] > _COVERED) & (seen.s[k] < SHOVEL_M)
            if not fit.used[c, k] or near.sum() < 2 * REDUNDANCY:
                of.append(None)
                continue
            mine = slice(REDUNDANCY * k, REDUNDANCY * (k + 1))
            believed = robust[near]
            noise = float((believed * fit.pixels.noise[near]).sum())
            # Where both skis are one line in an image, it tells one ski and not two, unless a person has drawn both.
            other = np.zeros_like(seen.cover[k]) if fit.drawn else seen.cover[1 - k]
            alone = fit.pixels.behind * (1 - other) + x[at.brightness[c, 1 - k]] * other
            front = (fit.pixels.grey - alone)[near] ** 2
            without, unexplained = (float((believed * square).sum()) - noise for square in (front, off[near] ** 2))
            explained = 1 - max(unexplained, 0.0) / without if without > 0 else 0.0
            evidence = float((believed * (front - off[near] ** 2) / fit.pixels.noise[near]).sum())
            visible = float(np.sqrt(believed).mean())
            spread = covariance[mine, mine], by_model[mine, mine]
            of.append(_line(view, poses, k, step[mine], spread, (explained, visible, evidence)))
        lines.append(of)
    return lines


def _line(
    view: SkiView, poses: Poses, k: int, step: Floats, spread: tuple[Floats, Floats], shares: tuple[float, float, float]
) -> ImageLine:
    covariance, by_model = spread
    s = np.concatenate((_S, [0.0]))
    px = view.camera.project(poses.point[k] + s[:, None] * poses.direction[k] + view.shift)
    chord = (px[-2] - px[0]) / np.hypot(*(px[-2] - px[0]))
    across = np.array((-chord[1], chord[0]))
    t = (px - px[-1]) @ chord
    # At this place along the line shift and turn are independent, and at that distance from it they weigh alike.
    middle = -covariance[0, 1] / covariance[1, 1]
    shift_variance = covariance[0, 0] - covariance[0, 1] ** 2 / covariance[1, 1]
    reach = float(np.sqrt(shift_variance / covariance[1, 1]))
    places = middle + np.array((-reach, reach))
    on_axis = np.column_stack([np.interp(places, t[:-1], px[:-1, i]) for i in (0, 1)])
    axes = np.column_stack((across, chord))
    shift = covariance[np.ix_((0, 2), (0, 2))]
    return ImageLine(
        on_axis + (step[0] + step[1] * places)[:, None] * across,
        float(np.sqrt(2 * shift_variance)),
        float(np.sqrt(by_model[0, 0] + middle * (2 * by_model[0, 1] + middle * by_model[1, 1]))),
        px[-1] + axes @ step[[0, 2]],
        axes @ shift @ axes.T,
        *shares,
        float(step @ np.linalg.solve(covariance, step)),
    )
