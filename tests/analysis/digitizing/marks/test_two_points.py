"""Two points stand for all that were measured along a line."""

import numpy as np
import pytest

from analysis.digitizing.marks.two_points import as_two_points


def test_two_points_say_as_much_as_all() -> None:
    random = np.random.default_rng(1)
    along = random.uniform(0, 80, 12)
    sigma = random.uniform(0.05, 0.3, 12)
    axis, across = np.array((0.8, 0.6)), np.array((-0.6, 0.8))
    places = []
    for _ in range(2000):
        off = random.normal(0, sigma) + random.normal(0, 0.1)
        two, each = as_two_points(along[:, None] * axis + off[:, None] * across, sigma, 0.1)
        places.append(two @ across)
    scatter = np.cov(np.array(places).T)
    both = np.array((scatter[0, 0], scatter[1, 1]))
    # Each has the sigma that is told, beside the shared part, which the sigma counts twice to be on the safe side.
    assert np.sqrt(both - 0.1**2) == pytest.approx(np.sqrt(each**2 - 2 * 0.1**2), rel=0.1)
    assert scatter[0, 1] == pytest.approx(0.1**2, abs=0.004)
