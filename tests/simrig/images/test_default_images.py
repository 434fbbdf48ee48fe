"""The training session looks as it always did: keys of a scenario that it does not use change nothing."""

from pathlib import Path

import numpy as np
import pytest

from simrig.world.scenario import Scenario
from tests.simrig.images.scenes import Renderer

#: Images from before the simulated hill had anything but jumper, noise and flakes: every eighth pixel of each camera,
#: and all pixels of the rows and columns around the jumper.
_KNOWN = Path(__file__).with_name("training.npz")
_PULSE = 45
_ROWS, _COLUMNS = slice(140, 250), slice(320, 480)


@pytest.mark.parametrize("camera", [0, 1, 2])
def test_the_training_session_looks_as_it_always_did(training: Scenario, camera: int) -> None:
    image = Renderer(training, camera, rate_hz=30.0)(_PULSE)
    with np.load(_KNOWN) as known:
        for name, part in (("all", image[::8, ::8]), ("jumper", image[_ROWS, _COLUMNS])):
            away = np.abs(part.astype(int) - known[f"{name}{camera}"])
            assert away.max() <= 1, "processors may round differently"
            assert (away > 0).mean() < 1e-3
