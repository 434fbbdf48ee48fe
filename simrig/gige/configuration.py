"""What a simulated GigE Vision camera is told when its process starts; its owner needs no more of it."""

import ipaddress
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, Field

from rig.settings.strict_toml import StrictModel
from simrig.gige.registers.makers import Maker
from simrig.gige.registers.register_table import MIN_WIDTH
from simrig.world.cable import CableEnd


def _ipv4(text: str) -> str:
    return str(ipaddress.IPv4Address(text))


class CameraConfig(StrictModel):
    """What a simulated camera is told when its process starts."""

    name: str = Field(description="name of the camera in the scenario")
    address: Annotated[str, AfterValidator(_ipv4)]
    scenario: Path
    rate_hz: float = Field(gt=0, le=10_000, description="rate of the hill's trigger pulses")
    epoch: int = Field(description="host time of hill pulse 0, ns")
    width: int = Field(640, ge=MIN_WIDTH, le=8192, multiple_of=4, description="width of the sensor, px")
    height: int = Field(480, ge=2, le=8192, multiple_of=2)
    test_pattern: bool = Field(False, description="show a plain pattern instead of the hill: costs nothing")
    prerendered: int = Field(
        0, ge=0, le=64, description="number of images that are rendered once; 0: render each frame"
    )
    link_mbit_s: float = Field(1000.0, ge=0, description="rate of the network cable; 0: as fast as possible")
    first_block_id: int = Field(1, ge=1, lt=1 << 63, description="block id of the first frame after each start")
    tick_hz: int = Field(1_000_000_000, ge=1000, le=10_000_000_000, description="ticks of the device clock per second")
    resend: bool = Field(True, description="whether the camera can send lost packets again")
    description: Path | None = Field(
        None,
        description="GenICam description (XML) of another camera, handed out as its own: registers are memory",
    )
    maker: Maker = Field(Maker.STANDARD, description="whose features the camera has")
    broadcast: str | None = Field(None, description="broadcast address for discovery, e.g. 127.255.255.255")
    line: CableEnd | None = Field(None, description="emulated line that triggers the camera, if its chip is there")
    ptp_offset_ns: int = Field(description="time of the PTP master minus host time, ns")
