"""Balls that no disc was found of are seen where the poses say that they are, and only where there are some."""

import numpy as np

from analysis.scene.orientation import orient_images
from tests.analysis.scene.hill import (
    balls_in,
    survey_json,
    survey_of,
    training,
    training_detections,
    training_images,
    without_balls,
)

#: Of one camera; seven balls stay.
_FORGOTTEN = ("B2", "B5", "B9")


def test_balls_without_a_disc_are_measured_where_the_poses_say() -> None:
    places, found = balls_in(training(), "K2"), dict(training_detections())
    forgotten = [name for name in places if name in _FORGOTTEN]
    off = np.array([np.hypot(*(found["K2"].xy - places[name]).T) for name in forgotten]).min(axis=0)
    found["K2"] = found["K2"].only(np.flatnonzero(off > 5.0))
    scene = orient_images(training_images(), survey_of(survey_json(training(), 1)), found)
    assert forgotten
    for name in forgotten:
        image = scene.balls[name].images["K2"]
        assert (np.abs(image[:2] - places[name]) < np.maximum(4 * image[2:], 0.05)).all(), name
    (said,) = (message for message in scene.messages if message.code == "scene_balls_sought")
    assert said.values == {"camera": "K2", "balls": ", ".join(forgotten)}


def test_no_ball_is_seen_where_there_is_none() -> None:
    images = training_images()
    bare = without_balls(images, training(), _FORGOTTEN)
    scene = orient_images({**images, "K2": bare["K2"]}, survey_of(survey_json(training(), 1)))
    assert scene.balls.keys() >= set(_FORGOTTEN) & balls_in(training(), "K1").keys()
    assert not any("K2" in scene.balls[name].images for name in _FORGOTTEN if name in scene.balls)
