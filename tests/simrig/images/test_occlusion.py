import numpy as np
import pytest

from simrig.world.figure.sight import IN_SIGHT, visible_shares
from simrig.world.jumper import JumpSeries
from simrig.world.scenario import Scenario
from tests.simrig.images.measuring import centroid
from tests.simrig.images.scenes import RATE_HZ, Renderer, with_keys
from tests.support.repeats import repeats

MARKERS = ("P1", "P2", "P3", "P4")


@pytest.fixture(scope="module")
def hidden(calm: Scenario) -> Scenario:
    return with_keys(calm, jumper={"occlusion": True})


@pytest.mark.parametrize("camera", repeats([0, 1, 2]))
def test_what_is_said_to_be_in_sight_is_what_is_drawn(hidden: Scenario, camera: int) -> None:
    """A marker's light is the difference between the images with it and with a marker as dark as its patch."""
    dark = with_keys(hidden, jumper={"marker": hidden.jumper.patch})
    with_light, without = Renderer(hidden, camera), Renderer(dark, camera)
    projection, jumps = hidden.cameras[camera].projection(640, 480), JumpSeries(hidden)
    wrong, seen = [], set()
    for pulse in range(36, 66):
        there = jumps.at(pulse / RATE_HZ)
        assert there is not None
        pose = there[0].pose(there[1])
        shares = visible_shares(hidden, pose, projection, 0)
        light = with_light(pulse).astype(float) - without(pulse)
        spots = projection.pixels(pose.markers)
        rows, columns = np.mgrid[:479, :640]
        nearest = np.argmin([np.hypot(columns - x, rows - y) for x, y in spots], axis=0)
        for i, share in enumerate(shares):
            radius = hidden.jumper.marker_radius_m * projection.c / float(projection.distance(pose.markers[i]))
            whole = np.pi * radius**2 * hidden.cameras[camera].gain * (225.0 - hidden.jumper.patch)
            drawn = float(light[nearest == i].sum()) / whole
            wrong.append(abs(drawn - share))
            seen.add((i, share >= IN_SIGHT))
            if share == 1.0 or drawn < 0.02:
                assert drawn == pytest.approx(share, abs=0.35)
    assert {(3, True), (0, True)} <= seen
    assert ((3, False) in seen) == (camera > 0), "the far ski's marker comes and goes where the camera looks up"
    assert np.mean(wrong) < 0.08


def test_markers_in_sight_are_true_where_others_are_hidden(hidden: Scenario) -> None:
    projection, jumps, image = hidden.cameras[0].projection(640, 480), JumpSeries(hidden), Renderer(hidden)
    errors = []
    for pulse in range(42, 66, 2):
        there = jumps.at(pulse / RATE_HZ)
        assert there is not None
        pose = there[0].pose(there[1])
        picture, spots = image(pulse), projection.pixels(pose.markers)
        for i in (0, 1):
            found = centroid(picture, spots[i].tolist(), 3.0)
            errors.append(float(np.hypot(*(np.array(found) - spots[i]))))
    assert np.median(errors) < 0.03
    assert max(errors) < 0.3


@pytest.mark.parametrize("marker", MARKERS)
def test_a_missing_marker_is_missing(calm: Scenario, marker: str) -> None:
    bare = with_keys(calm, jumper={"missing_markers": [{"marker": marker, "jump": 0}]})
    pose = JumpSeries(calm).at(1.5)
    assert pose is not None
    projection = calm.cameras[0].projection(640, 480)
    shares = visible_shares(bare, pose[0].pose(pose[1]), projection, 0)
    assert [share == 0 for share in shares] == [name == marker for name in MARKERS]
    x, y = np.rint(projection.pixels(pose[0].pose(pose[1]).markers[MARKERS.index(marker)])).astype(int)
    with_it, without = Renderer(calm, rate_hz=30.0)(45), Renderer(bare, rate_hz=30.0)(45)
    assert int(with_it[y, x]) > int(without[y, x]) + 20 or marker in {"P3", "P4"}
    assert not np.array_equal(with_it, without)
    later = with_keys(calm, jumper={"missing_markers": [{"marker": marker, "jump": 1}]})
    assert np.array_equal(Renderer(later, rate_hz=30.0)(45), with_it), "another jump"


def test_markers_may_be_darker_than_the_suit(calm: Scenario) -> None:
    inverted = with_keys(calm, jumper={"marker": 20.0, "patch": 190.0, "suit": 150.0, "skis": 60.0})
    image = 255 - Renderer(inverted)(50)
    there = JumpSeries(inverted).at(50 / RATE_HZ)
    assert there is not None
    for spot in inverted.cameras[0].projection(640, 480).pixels(there[0].pose(there[1]).markers):
        assert np.hypot(*np.subtract(centroid(image, spot.tolist(), 3.0), spot)) < 0.05
