"""A whole simulated GigE Vision camera, put together from its parts."""

import ipaddress
import random
import time

from rig.clocks import HostNs
from rig.errors import BadInputError
from simrig.device_clock import DeviceClock
from simrig.faults import OF_THE_CAMERA, Fault, FaultPlan
from simrig.gige.camera_clock import CameraClock, PtpMaster
from simrig.gige.config import CameraConfig
from simrig.gige.control_server import ControlServer
from simrig.gige.counters import Counters, GigeStatistics
from simrig.gige.device import Device, Parts
from simrig.gige.features import features
from simrig.gige.genicam import describe
from simrig.gige.link import Link
from simrig.gige.register_table import all_registers
from simrig.gige.registers import RegisterMap
from simrig.gige.sensor import Sensor
from simrig.gige.transmitter import Transmitter
from simrig.gige.values import XML_ADDRESS, Identity
from simrig.image_source import ImageSource, Painter, TestPattern
from simrig.images.view import CameraView
from simrig.pulse_train import PulseTrain
from simrig.world.scenario import Scenario, load_scenario

_PTP_ERROR_NS = 300


class Camera:
    """A camera on the network, from `start` to `stop`.

    Raises:
        BadInputError: the scenario is broken or has no such camera, or the address cannot be bound.
    """

    def __init__(self, config: CameraConfig) -> None:
        scenario = load_scenario(config.scenario)
        index = scenario.camera_index(config.name)
        self._counters = Counters()
        self._faults = FaultPlan(f for f in scenario.faults_of(config.name) if f.kind not in OF_THE_CAMERA)
        registers = _registers(config)
        clock = _clock(config, scenario, index)
        painter = _painter(config, scenario, index)
        train = PulseTrain(HostNs(config.epoch), config.rate_hz, scenario.pauses)
        self._link = Link(config.address, config.link_mbit_s)
        self._transmitter = Transmitter(self._link, self._counters)
        self._sensor = Sensor(
            train, self._faults, painter, clock, registers, self._transmitter, self._link, self._counters,
            config.first_block_id,
        )  # fmt: skip
        self._device = Device(
            Parts(registers, clock, painter, self._link, self._transmitter, self._sensor, self._counters)
        )
        try:
            self._server = ControlServer(self._device, config.address, config.broadcast)
        except BadInputError:
            self._link.close()
            raise

    def start(self) -> None:
        """Be there."""
        self._transmitter.start()
        self._sensor.start()
        self._server.start()

    def stop(self) -> None:
        """Be gone."""
        self._server.stop()
        self._sensor.stop()
        self._transmitter.stop()
        self._link.close()

    def inject(self, fault: Fault) -> None:
        """Let something go wrong.

        Raises:
            BadInputError: its pulses are past, or it is a fault of the process.
        """
        if fault.kind in OF_THE_CAMERA:
            raise BadInputError(f"fault {fault.kind} befalls the process: inject it into the SimulatedHill")
        self._faults.inject(fault)

    def statistics(self) -> GigeStatistics:
        """What the camera did so far."""
        counters = self._counters
        return GigeStatistics(
            counters.triggers,
            counters.missed,
            counters.overruns,
            counters.frames,
            self._link.packets,
            self._link.bytes,
            time.process_time(),
            self._sensor.acquiring,
            self._device.control.controller is not None,
            dict(counters.last_packets.copy()),
            counters.resend_requests,
            counters.resent_packets,
            self._sensor.block_id,
        )


def _registers(config: CameraConfig) -> RegisterMap:
    """The camera's registers and its description."""
    address = int(ipaddress.IPv4Address(config.address))
    sensor = (config.width, config.height)
    identity = Identity(f"SIM-{address & 0xFFFFFF:06X}", config.name, address, sensor, config.tick_hz, config.resend)
    xml = describe(features(all_registers(identity, 0)))
    return RegisterMap(all_registers(identity, len(xml)), {XML_ADDRESS: xml})


def _clock(config: CameraConfig, scenario: Scenario, index: int) -> CameraClock:
    """The camera's clock; what PTP leaves over differs from camera to camera."""
    noise = random.Random(f"{scenario.seed}/{index}/ptp")  # noqa: S311  (no secret)
    master = PtpMaster(config.ptp_offset_ns, round(noise.uniform(-_PTP_ERROR_NS, _PTP_ERROR_NS)))
    return CameraClock(DeviceClock(scenario, index, HostNs(config.epoch)), master, config.tick_hz)


def _painter(config: CameraConfig, scenario: Scenario, index: int) -> Painter:
    width, height = config.width, config.height
    source: ImageSource = (
        TestPattern(width, height)
        if config.test_pattern
        else CameraView(scenario, index, width, height, config.rate_hz)
    )
    return Painter(source, (width, height), index if scenario.stamp else None, config.prerendered)
