import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import pytest

from rig.clocks import HostNs, host_now
from rig.settings.file import CONFIG
from simrig.gige.camera import Camera
from simrig.gige.configuration import CameraConfig
from simrig.world.pulses import DeviceClock, PulseTrain
from simrig.world.scenario import load_scenario
from tests.support.loopback import Loopback

TRAINING = CONFIG / "scenarios" / "training.toml"
RATE_HZ = 60.0


class SimulatedCamera:
    """A camera in this process, and what is true of it."""

    def __init__(self, camera: Camera, config: CameraConfig) -> None:
        self.camera, self.config = camera, config
        self.address = config.address
        self.train = PulseTrain(HostNs(config.epoch), config.rate_hz)
        scenario = load_scenario(config.scenario)
        self.clock = DeviceClock(scenario, scenario.camera_index(config.name), HostNs(config.epoch))


MakeCamera = Callable[..., SimulatedCamera]


@pytest.fixture
def make_camera(loopback: Loopback) -> Iterator[MakeCamera]:
    """Starts a simulated camera in this process: K1 at the first address, K2 at the second, ..."""
    with ExitStack() as cameras:

        def make(name: str = "K1", **options: Any) -> SimulatedCamera:
            given = {
                "name": name, "address": loopback.cameras(3)[int(name[1:]) - 1], "scenario": TRAINING,
                "rate_hz": RATE_HZ, "epoch": host_now(), "test_pattern": True, "width": 320, "height": 240,
                "ptp_offset_ns": time.time_ns() - time.monotonic_ns(), **options,
            }  # fmt: skip
            config = CameraConfig(**given)
            return SimulatedCamera(cameras.enter_context(_running(config)), config)

        yield make


@contextmanager
def _running(config: CameraConfig) -> Iterator[Camera]:
    camera = Camera(config)
    camera.start()
    try:
        yield camera
    finally:
        camera.stop()


@pytest.fixture
def scenario_with(tmp_path: Path) -> Callable[[str], Path]:
    """Writes a scenario that is the training session and what the test adds."""

    def write(toml: str) -> Path:
        path = tmp_path / "scenario.toml"
        path.write_text(f'base = "{TRAINING}"\n{toml}')
        return path

    return write
