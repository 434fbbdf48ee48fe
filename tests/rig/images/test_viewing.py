"""One `look_at` and one sense of `roll_deg` for scenarios and planned networks."""

import numpy as np
import pytest

from photogrammetry.planning.description import Description
from photogrammetry.planning.plan import plan_from
from rig.images.viewing import look_at
from rig.settings.strict_toml import validate
from simrig.world.scenario import SceneCamera

X0, TARGET = (-21.7, -30.9, 8.5), (8.1, 0.0, -2.9)


def test_without_roll_the_rows_are_horizontal_and_the_columns_point_up() -> None:
    rotation = look_at(X0, TARGET)
    assert rotation[2, 0] == pytest.approx(0.0, abs=1e-12)
    assert rotation[2, 1] > 0.9
    assert rotation[:, 2] @ np.subtract(TARGET, X0) < 0.0


def test_a_positive_roll_turns_the_camera_clockwise_as_seen_from_behind() -> None:
    """A camera that looks along +Y and is turned by 90 degrees: its right side points down, its upper side right."""
    rotation = look_at((0.0, 0.0, 0.0), (0.0, 10.0, 0.0), 90.0)
    assert rotation[:, 0] == pytest.approx((0.0, 0.0, -1.0), abs=1e-12)
    assert rotation[:, 1] == pytest.approx((1.0, 0.0, 0.0), abs=1e-12)


@pytest.mark.parametrize("roll", [0.0, 90.0, -90.0, 12.5])
def test_scenarios_and_planned_networks_turn_the_same_way(roll: float) -> None:
    view = {"X0": list(X0), "look_at": list(TARGET), "roll_deg": roll}
    camera = {"name": "K1", "size": [640, 480], "c": 1420.0, "images": [view]}
    description = {"name": "one camera", "length_unit": "m", "sigma": {"image": 0.3}, "cameras": [camera]}
    planned = plan_from(validate(Description, description, "network.toml")).network.images[0].rotation
    scene = SceneCamera.model_validate({"name": "K1", "c": 1420, **view}).rotation()
    assert planned is not None
    np.testing.assert_array_equal(planned, scene)
