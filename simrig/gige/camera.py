"""A whole simulated GigE Vision camera: its configuration, and the camera put together from its parts."""

import ipaddress
import random
import time
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, Field

from rig.clocks import HostNs
from rig.errors import BadInputError
from rig.settings.strict_toml import StrictModel
from simrig.gige.control.control_server import ControlServer
from simrig.gige.control.device import Device
from simrig.gige.imaging.camera_clock import CameraClock, PtpMaster
from simrig.gige.imaging.sensor import Sensor
from simrig.gige.imaging.transmitter import Transmitter
from simrig.gige.protocol.link import Link
from simrig.gige.registers.genicam import describe
from simrig.gige.registers.makers import DIALECTS, Maker, registers_of
from simrig.gige.registers.register_map import RegisterMap
from simrig.gige.registers.register_table import MIN_WIDTH, XML_ADDRESS, Identity, all_registers
from simrig.images.painter import Painter
from simrig.world.cable import Cable, CableEnd, CableWatch
from simrig.world.faults import OF_THE_CAMERA, Fault, FaultPlan
from simrig.world.pulses import DeviceClock, PulseTrain
from simrig.world.scenario import Scenario, load_scenario
from simrig.world.statistics import CameraStatistics, Counters

_PTP_ERROR_NS = 300


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
    maker: Maker = Field(Maker.STANDARD, description="whose features the camera has")
    broadcast: str | None = Field(None, description="broadcast address for discovery, e.g. 127.255.255.255")
    line: CableEnd | None = Field(None, description="emulated line that triggers the camera, if its chip is there")
    ptp_offset_ns: int = Field(description="time of the PTP master minus host time, ns")


class Camera:
    """A camera on the network, from `start` to `stop`.

    Raises:
        BadInputError: the scenario is broken or has no such camera, or the address cannot be bound.
    """

    def __init__(self, config: CameraConfig) -> None:
        scenario = load_scenario(config.scenario)
        index = scenario.camera_index(config.name)
        size = (config.width, config.height)
        painter = Painter(
            scenario, index, size, config.rate_hz, test_pattern=config.test_pattern, prerendered=config.prerendered
        )
        train = PulseTrain(HostNs(config.epoch), config.rate_hz, scenario.pauses)
        cable = None if config.line is None else Cable.plugged(config.line)
        registers, clock = _registers(config), _clock(config, scenario, index)
        self._faults = FaultPlan(f for f in scenario.faults_of(config.name) if f.kind not in OF_THE_CAMERA)
        self._counters = Counters()
        self._link = Link(config.address, config.link_mbit_s, self._counters)
        self._transmitter = Transmitter(self._link, self._counters)
        self._sensor = Sensor(
            train, self._faults, painter, clock, registers, self._transmitter, self._counters, config.first_block_id,
            cable=cable is not None,
        )  # fmt: skip
        self._cable = None if cable is None else CableWatch(cable, self._sensor.edge)
        self._device = Device(registers, clock, painter, self._transmitter, self._sensor)
        try:
            self._server = ControlServer(self._device, config.address, config.broadcast)
        except BadInputError:
            self._link.close()
            if cable is not None:
                cable.close()
            raise

    def start(self) -> None:
        """Start the threads; the camera answers from now on."""
        self._transmitter.start()
        self._sensor.start()
        if self._cable is not None:
            self._cable.start()
        self._server.start()

    def stop(self) -> None:
        """Stop the threads and close the sockets."""
        self._server.stop()
        if self._cable is not None:
            self._cable.stop()
        self._sensor.stop()
        self._transmitter.stop()
        self._link.close()

    def inject(self, fault: Fault) -> None:
        """Add a fault.

        Raises:
            BadInputError: its pulses are past, or it is a fault of the process.
        """
        if fault.kind in OF_THE_CAMERA:
            raise BadInputError(f"fault {fault.kind} befalls the process: inject it into the SimulatedHill")
        self._faults.inject(fault)

    def statistics(self) -> CameraStatistics:
        """What the camera did so far."""
        return self._counters.report(
            cpu_s=time.process_time(),
            acquiring=self._sensor.acquiring,
            controlled=self._device.control.controller is not None,
        )


def _registers(config: CameraConfig) -> RegisterMap:
    """The camera's registers and its GenICam description."""
    address = int(ipaddress.IPv4Address(config.address))
    sensor = (config.width, config.height)
    identity = Identity(f"SIM-{address & 0xFFFFFF:06X}", config.name, address, sensor, config.tick_hz, config.resend)
    maker = config.maker
    xml = describe(registers_of(maker, all_registers(identity, 0)), DIALECTS[maker])
    return RegisterMap(registers_of(maker, all_registers(identity, len(xml))), {XML_ADDRESS: xml})


def _clock(config: CameraConfig, scenario: Scenario, index: int) -> CameraClock:
    """The camera's clock; the remaining error of PTP differs from camera to camera."""
    noise = random.Random(f"{scenario.seed}/{index}/ptp")  # noqa: S311  (no secret)
    master = PtpMaster(config.ptp_offset_ns, round(noise.uniform(-_PTP_ERROR_NS, _PTP_ERROR_NS)))
    return CameraClock(DeviceClock(scenario, index, HostNs(config.epoch)), master, config.tick_hz)
