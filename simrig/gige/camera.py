"""A whole simulated GigE Vision camera, put together from its parts."""

import ipaddress
import random
import time
from dataclasses import replace
from pathlib import Path

from rig.clocks import HostNs
from rig.errors import BadInputError
from simrig.gige.configuration import CameraConfig
from simrig.gige.control.control_server import ControlServer
from simrig.gige.control.device import Device
from simrig.gige.imaging.camera_clock import CameraClock, PtpMaster
from simrig.gige.imaging.sensor import Sensor
from simrig.gige.imaging.transmitter import Transmitter
from simrig.gige.protocol.link import Link
from simrig.gige.registers.described_map import DESCRIPTION_ADDRESS, DescribedMap
from simrig.gige.registers.genicam import describe
from simrig.gige.registers.makers import DIALECTS, registers_of
from simrig.gige.registers.register_map import WORD, RegisterMap
from simrig.gige.registers.register_table import XML_ADDRESS, Identity, all_registers
from simrig.images.painter import Painter
from simrig.world.cable import Cable, CableWatch
from simrig.world.faults import OF_THE_CAMERA, Fault, FaultPlan
from simrig.world.pulses import DeviceClock, PulseTrain
from simrig.world.scenario import Scenario, load_scenario
from simrig.world.statistics import CameraStatistics, Counters

_PTP_ERROR_NS = 300


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
    if config.description is not None:
        return _described(config.description, identity)
    xml = describe(registers_of(maker, all_registers(identity, 0)), DIALECTS[maker])
    return RegisterMap(registers_of(maker, all_registers(identity, len(xml))), {XML_ADDRESS: xml})


def _described(path: Path, identity: Identity) -> DescribedMap:
    """The registers of a camera with the description of another."""
    xml = path.read_bytes()
    xml += b"\n" * (-len(xml) % WORD)
    url = f"Local:{path.stem}.xml;{DESCRIPTION_ADDRESS:x};{len(xml):x}"
    registers = [
        replace(each, default=url) if each.name == "GevFirstURL" else each for each in all_registers(identity, len(xml))
    ]
    return DescribedMap(registers, xml)


def _clock(config: CameraConfig, scenario: Scenario, index: int) -> CameraClock:
    """The camera's clock; the remaining error of PTP differs from camera to camera."""
    noise = random.Random(f"{scenario.seed}/{index}/ptp")  # noqa: S311  (no secret)
    master = PtpMaster(config.ptp_offset_ns, round(noise.uniform(-_PTP_ERROR_NS, _PTP_ERROR_NS)))
    return CameraClock(DeviceClock(scenario, index, HostNs(config.epoch)), master, config.tick_hz)
