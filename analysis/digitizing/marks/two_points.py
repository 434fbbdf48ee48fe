"""Two points that stand for all that were measured along a line."""

import numpy as np

from rig.arrays import Floats


def as_two_points(xy: Floats, sigma: Floats, common: float) -> tuple[Floats, float]:
    """Two points of a line that say as much of its place and turn as the points that were measured along it.

    They lie at the root mean square distance of the points from their centre. The error that all points share counts
    fully in each.

    Args:
        xy: (k, 2) px.
        sigma: (k,) standard deviations across the line, px.
        common: standard deviation of the error across the line that all points share, px.

    Returns:
        The points (2, 2), px, and the standard deviation of each across the line, independent of the other's.
    """
    begin, end = _outer(xy)
    axis = (end - begin) / np.hypot(*(end - begin))
    across = np.array((-axis[1], axis[0]))
    weight = np.asarray(sigma, float) ** -2.0
    centre = (weight[:, None] * xy).sum(axis=0) / weight.sum()
    along, aside = (xy - centre) @ axis, (xy - centre) @ across
    direction = axis + (weight * along * aside).sum() / (weight * along**2).sum() * across
    direction = direction / np.hypot(*direction)
    reach = float(np.sqrt((weight * along**2).sum() / weight.sum()))
    places = centre + np.array(((-reach,), (reach,))) * direction
    return places, float(np.sqrt(2 / weight.sum() + 2 * common**2))


def _outer(line: Floats) -> tuple[Floats, Floats]:
    away = np.linalg.norm(line[:, None] - line[None], axis=2)
    i, j = np.unravel_index(away.argmax(), away.shape)
    return line[min(i, j)], line[max(i, j)]
