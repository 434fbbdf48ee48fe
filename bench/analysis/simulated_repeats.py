"""One jump measured twice, without images: simulated measurements, computed as those of a recording are."""

from typing import Final

import numpy as np

from analysis.cameras.oriented_scene import calibration_id, parameter_names
from analysis.comparison.aligned import MeasuredJump, measured_jump
from analysis.procedure.jump import compute_jump
from analysis.result.model import MeasuredRecording, OrientationResult
from analysis.scene.camera_system import CameraSystem
from bench.analysis.simulated import (
    RATE_HZ,
    TrueJump,
    drawn,
    simulated_measurements,
    training,
    true_cameras,
    true_jump,
)

_GOLDEN: Final = 0.6180339887  # of a pulse, from draw to draw: the take-off lies anywhere between two pulses


def measured_twice(draw: int) -> tuple[MeasuredJump, MeasuredJump]:
    """A jump as two recordings measured it, whose cameras were oriented once; each draw is another jump and survey."""
    scenario = training().model_copy(update={"first_takeoff_s": 1.0 + draw * _GOLDEN % 1.0 / RATE_HZ})
    truth = true_jump(draw, RATE_HZ, scenario)
    system = drawn(true_cameras(), np.random.default_rng((draw, 1)))
    return _measured(truth, system, 2 * draw), _measured(truth, system, 2 * draw + 1)


def _measured(truth: TrueJump, system: CameraSystem, number: int) -> MeasuredJump:
    measurements = simulated_measurements(truth, true_cameras(), np.random.default_rng((number, 2)))
    computed = compute_jump(measurements.jumps[0], measurements, system)
    orientation = OrientationResult({}, {}, (), (), parameter_names(system), system.covariance, calibration_id(system))
    name = f"recording {number}"
    recording = MeasuredRecording(name, {}, RATE_HZ, orientation, computed.synchrony, (computed.jump,))
    return measured_jump(recording, 1, name)
