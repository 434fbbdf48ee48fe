"""How often a camera shows a binding: from its own side, from the other one, and from the front."""

import numpy as np
import pytest

from analysis.identification.space.sides import shown
from analysis.identification.space.views import Views
from tests.analysis.simulated import true_cameras


def test_the_far_binding_is_shown_less_often() -> None:
    views = Views(true_cameras())
    place = np.array((5.0, 0.0, -1.0))
    left = np.array((0.0, 1.0, 0.0))
    share = shown(views, place[None], left)
    aside = [
        float((camera.position - place) @ left / np.linalg.norm(camera.position - place)) for camera in views.placed
    ]
    assert max(aside) < 0.0  # all cameras stand on his right side
    assert share[:3] == pytest.approx(1.0)
    assert share[3] == pytest.approx(1.0 + 0.5 * np.array(aside))
    assert shown(views, place[None], -left)[2] == pytest.approx(share[3])
