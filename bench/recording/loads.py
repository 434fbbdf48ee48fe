"""The loads that capture is measured under, and the rig that makes each."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from rig.settings.camera import CameraSettings, Region
from rig.settings.file import CONFIG
from rig.settings.model import NetworkSettings, RecorderSettings, RigSettings, SimulationSettings
from rig.settings.trigger import ExternalTrigger

#: Frames that the simulated cameras draw once and only stamp anew: drawing is not what is measured.
PRERENDERED = 8
SCENARIO: Final = CONFIG / "scenarios" / "training.toml"


@dataclass(frozen=True, slots=True)
class Load:
    """Cameras of one size at one rate.

    Attributes:
        cameras: how many.
        link_mbit_s: pace of each simulated camera's packets; 0: as fast as it can.
    """

    name: str
    width: int
    height: int
    rate_hz: float
    link_mbit_s: int
    cameras: int = 3

    @property
    def bytes_per_s(self) -> float:
        """Image data of all cameras."""
        return self.cameras * self.width * self.height * self.rate_hz

    def rig(self, directory: Path, publish: str, scenario: Path = SCENARIO) -> RigSettings:
        """A rig of simulated GigE Vision cameras under this load."""
        region = Region(width=self.width, height=self.height)
        cameras = tuple(
            CameraSettings(
                name=f"K{i + 1}", backend="aravis", address=f"127.0.0.{11 + i}", region=region, exposure_us=500.0
            )
            for i in range(self.cameras)
        )
        return RigSettings(
            name=f"bench, {self.name}",
            cameras=cameras,
            trigger=ExternalTrigger(rate_hz=self.rate_hz, settle_s=10.0),
            recorder=RecorderSettings(directory=directory),
            network=NetworkSettings(publish=publish),
            simulation=SimulationSettings(scenario=scenario),
        )


LOADS = {
    load.name: load
    for load in (
        Load("paper", 640, 480, 30.0, 1000),
        Load("saturated", 1936, 1216, 50.0, 1000),
        Load("double", 1936, 1216, 100.0, 2500),
    )
}
#: Loads under which nothing may be lost, however many cameras there are and however fast they are.
MANY = {
    load.name: load for load in (Load("cameras-8", 640, 480, 30.0, 1000, 8), Load("hertz-200", 640, 480, 200.0, 1000))
}
