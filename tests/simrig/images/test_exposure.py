import math

import numpy as np
import pytest

from simrig.images import exposure
from simrig.world.jumper import JumpSeries
from simrig.world.scenario import Scenario
from tests.simrig.images.measuring import centroid
from tests.simrig.images.scenes import RATE_HZ, Renderer, with_keys


@pytest.mark.parametrize("camera", [0, 1, 2])
@pytest.mark.parametrize("exposure_us", [1000.0, 4000.0])
def test_a_blurred_marker_lies_where_it_was_at_the_middle_of_the_exposure(
    calm: Scenario, camera: int, exposure_us: float
) -> None:
    scenario = with_keys(calm, cameras={"exposure_us": exposure_us})
    jumps, image = JumpSeries(scenario), Renderer(scenario, camera)
    settings, errors = scenario.cameras[camera], []
    for pulse in range(40, 62, 3):
        there = jumps.at(pulse / RATE_HZ + exposure_us / 2e6)
        assert there is not None
        spot = settings.projection(640, 480).pixels(there[0].pose(there[1]).markers[0])
        way = float(np.hypot(*np.diff(settings.projection(640, 480).pixels(
            [there[0].origin(there[1] - exposure_us / 2e6), there[0].origin(there[1] + exposure_us / 2e6)]
        ), axis=0)[0]))  # fmt: skip
        found = centroid(image(pulse), spot.tolist(), 3.8 + min(way / 4, 0.8))
        errors.append(float(np.hypot(*(np.array(found) - spot))))
        begin = settings.projection(640, 480).pixels(there[0].pose(there[1] - exposure_us / 2e6).markers[0])
        assert way < 0.5 or np.hypot(*(np.array(found) - begin)) > way / 4, "the begin of the exposure is elsewhere"
    assert max(errors) < 0.1


def test_a_marker_is_smeared_along_its_way(calm: Scenario) -> None:
    scenario = with_keys(calm, cameras={"exposure_us": 6000.0})
    jumps = JumpSeries(scenario)
    there = jumps.at(50 / RATE_HZ + 3e-3)
    assert there is not None
    projection = scenario.cameras[0].projection(640, 480)
    way = np.diff(projection.pixels([there[0].pose(there[1] + h).markers[0] for h in (-3e-3, 3e-3)]), axis=0)[0]
    x, y = np.rint(projection.pixels(there[0].pose(there[1]).markers[0])).astype(int)
    dark = with_keys(scenario, jumper={"marker": scenario.jumper.patch})
    weight = (Renderer(scenario)(50).astype(float) - Renderer(dark)(50))[y - 8 : y + 9, x - 8 : x + 9]
    rows, columns = np.mgrid[-8:9, -8:9]
    along = (columns * way[0] + rows * way[1]) / math.hypot(*way)
    across = (columns * -way[1] + rows * way[0]) / math.hypot(*way)

    def variance(u: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> float:
        mean = (weight * u).sum() / weight.sum()
        return float((weight * (u - mean) ** 2).sum() / weight.sum())

    assert variance(along) - variance(across) == pytest.approx(math.hypot(*way) ** 2 / 12, rel=0.4)


def test_an_exposure_is_divided_symmetrically_and_finely_enough(calm: Scenario) -> None:
    there = JumpSeries(calm).at(1.5)
    assert there is not None
    jump, time_s = there
    projection = calm.cameras[0].projection(640, 480)
    assert len(exposure.poses(jump, time_s, 0.0, projection)) == 1
    few, many = (exposure.poses(jump, time_s, e, projection) for e in (1e-3, 5e-3))
    assert 1 < len(few) < len(many)
    middle = np.mean([pose.origin for pose in many], axis=0)
    assert middle == pytest.approx(jump.origin(time_s), abs=1e-4)
    places = projection.pixels(np.array([pose.origin for pose in many]))
    assert np.hypot(*np.diff(places, axis=0).T).max() < 1.3


def test_a_camera_that_is_late_shows_a_later_moment(calm: Scenario) -> None:
    late = Renderer(with_keys(calm, cameras={"late_ms": 1000 / RATE_HZ}))
    assert np.array_equal(late(50), Renderer(calm)(51))
