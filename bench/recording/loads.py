"""The loads that capture is measured under, and the rig that makes each."""

from dataclasses import dataclass
from pathlib import Path

from rig.settings.file import CONFIG
from rig.settings.model import (
    CameraSettings,
    NetworkSettings,
    RecorderSettings,
    Region,
    RigSettings,
    SimulationSettings,
)
from rig.settings.trigger import ExternalTrigger

#: Frames that the simulated cameras draw once and only stamp anew: drawing is not what is measured.
PRERENDERED = 8


@dataclass(frozen=True, slots=True)
class Load:
    """Three cameras of one size at one rate.

    Attributes:
        link_mbit_s: pace of each simulated camera's packets; 0: as fast as it can.
    """

    name: str
    width: int
    height: int
    rate_hz: float
    link_mbit_s: int

    @property
    def bytes_per_s(self) -> float:
        """Image data of the three cameras."""
        return 3 * self.width * self.height * self.rate_hz

    def rig(self, directory: Path, publish: str) -> RigSettings:
        """A rig of three simulated GigE Vision cameras under this load."""
        region = Region(width=self.width, height=self.height)
        cameras = tuple(
            CameraSettings(
                name=f"K{i + 1}", backend="aravis", address=f"127.0.0.{11 + i}", region=region, exposure_us=500.0
            )
            for i in range(3)
        )
        return RigSettings(
            name=f"bench, {self.name}",
            cameras=cameras,
            trigger=ExternalTrigger(rate_hz=self.rate_hz, settle_s=10.0),
            recorder=RecorderSettings(directory=directory),
            network=NetworkSettings(publish=publish),
            simulation=SimulationSettings(scenario=CONFIG / "scenarios" / "training.toml"),
        )


LOADS = {
    load.name: load
    for load in (
        Load("paper", 640, 480, 30.0, 1000),
        Load("saturated", 1936, 1216, 50.0, 1000),
        Load("double", 1936, 1216, 100.0, 2500),
    )
}
