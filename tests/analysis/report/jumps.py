"""A log with rendered images of the jump that `tests.analysis.result.recordings` measures, and its measurements."""

from functools import cache, partial
from pathlib import Path

import numpy as np

from analysis.measurements.model import Measurements
from analysis.result.model import MeasuredRecording
from recorder.log.triplet_buffers import TripletBuffers
from recorder.writing.log_writer import LogDescription
from rig.clocks import UtcNs
from rig.frame import FrameStatus
from rig.pulse import HillPulse
from simrig.images.view import CameraView
from tests.analysis.result.recordings import model, recording
from tests.analysis.simulated import RATE_HZ, SIZE, START_NS, simulated_measurements, training, true_cameras
from tests.recorder.logs import RIG, RIG_TOML, SESSION, acquire, make_tag, open_writer
from tests.support.kept import kept

SHAPE = (SIZE[1], 3 * SIZE[0])
EVERY = 4  #: pulses from image to image, to save time
JUMP_SEED = 1


def imaged_pulses(every: int = EVERY) -> list[int]:
    """Pulses in the log: some before the jumper's first one, and some after the last."""
    pulses = model(JUMP_SEED).pulses
    return list(range(pulses[0] - every, pulses[-1] + 2 * every, every))


def jump_log(every: int = EVERY, lost: str = "") -> Path:
    """The log of a jump, not to be changed; `lost`: a camera that never delivers a frame."""
    return kept("jump-log", partial(_write, every=every, lost=lost), every, lost) / "log.mcap"


def _write(folder: Path, every: int, lost: str) -> None:
    scenario = training().model_copy(update={"seed": JUMP_SEED})
    views = [CameraView(scenario, camera, *SIZE, RATE_HZ) for camera in range(3)]
    statuses = [FrameStatus.LOST if camera.name == lost else FrameStatus.OK for camera in scenario.cameras]
    buffers = TripletBuffers(SHAPE, 4)
    with open_writer(folder / "log.mcap", buffers, LogDescription(SESSION, RIG, RIG_TOML)) as log:
        for pulse in imaged_pulses(every):
            slot = acquire(buffers)
            image = buffers.pixels(slot)
            for camera, view in enumerate(views):
                view.render_into(image[:, camera * SIZE[0] : (camera + 1) * SIZE[0]], HillPulse(pulse))
            time = UtcNs(START_NS + round(pulse * 1e9 / RATE_HZ))
            log.write_pulse(make_tag(pulse, statuses, SHAPE, time), slot, time)
    buffers.close()


@cache
def measurements() -> Measurements:
    """What is measured in its images."""
    return simulated_measurements(model(JUMP_SEED).truth, true_cameras(), np.random.default_rng(3))


@cache
def measured_recording() -> MeasuredRecording:
    """The recording; not to be changed."""
    return recording(JUMP_SEED)
