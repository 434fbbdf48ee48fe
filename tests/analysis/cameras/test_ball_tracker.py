"""Balls near the border of an image: their surroundings are matched where all of them are in it."""

import numpy as np
import pytest

from analysis.cameras.ball_tracker import BallTracker
from tests.analysis.scene.hill import training_images
from tests.analysis.simulated import true_cameras


@pytest.mark.parametrize("corner", [(0.0, 0.0), (639.0, 479.0)], ids=["left and top", "right and bottom"])
def test_a_ball_may_be_anywhere_at_the_border(corner: tuple[float, float]) -> None:
    image, rng = training_images()["K1"], np.random.default_rng(3)
    inward = np.sign((319.5, 239.5) - np.array(corner))
    places = {f"B{i}": corner + inward * rng.uniform(0, 40, 2) for i in range(200)}
    balls = {name: rng.normal(0, 5, 3) for name in places}
    tracker = BallTracker(true_cameras()["K1"], image, balls, places)
    assert 0 < len(tracker.names) < len(places)
    assert tracker.places == pytest.approx(np.array([places[name] for name in tracker.names]))
