"""The training session looks as it always did: keys of a scenario that it does not use change nothing."""

import hashlib

import numpy as np

from rig.pulse import HillPulse
from simrig.images.view import CameraView
from simrig.world.scenario import Scenario

#: Of pulses 0 to 119 at 30 Hz and 640 x 480, all three cameras.
_KNOWN = "24c1e51790cfcca3b97f8ae8485bfbf5f2f7e8417a0277c2aee00cacf702c305"


def test_the_training_session_looks_as_it_always_did(training: Scenario) -> None:
    digest, out = hashlib.sha256(), np.empty((480, 640), np.uint8)
    for camera in range(len(training.cameras)):
        view = CameraView(training, camera, 640, 480, 30.0)
        for pulse in range(120):
            view.render_into(out, HillPulse(pulse))
            digest.update(out.tobytes())
    assert digest.hexdigest() == _KNOWN
