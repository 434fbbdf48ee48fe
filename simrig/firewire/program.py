"""The bus and its cameras put together from their parts, and the commands that they obey."""

import contextlib
import os
import socket
import threading
import time
from dataclasses import asdict
from typing import Final

from rig.clocks import HostNs
from rig.errors import BadInputError
from rig.rigfile import validate
from simrig.camera_program import Message
from simrig.device_clock import DeviceClock
from simrig.faults import OF_THE_CAMERA, Fault, FaultPlan
from simrig.firewire.bus import Bus
from simrig.firewire.camera import Camera
from simrig.firewire.config import BusConfig, guid_number
from simrig.firewire.cycle_timer import CycleTimer
from simrig.firewire.geometry import SENSOR, VGA
from simrig.firewire.loop import Loop
from simrig.firewire.sensor import Line
from simrig.image_source import ImageSource, Painter, TestPattern
from simrig.images.view import CameraView
from simrig.pulse_train import PulseTrain
from simrig.statistics import CameraStatistics
from simrig.world.scenario import Scenario, load_scenario

_JOIN_S: Final = 10.0
_NICENESS: Final = -10


class BusProgram:
    """See `simrig.camera_program.Program`.

    Raises:
        BadInputError: the scenario is broken or has no such camera, or the socket's name is taken.
    """

    def __init__(self, config: BusConfig) -> None:
        scenario = load_scenario(config.scenario)
        train = PulseTrain(HostNs(config.epoch), config.rate_hz, scenario.pauses)
        first = scenario.camera_index(next(iter(config.cameras)))
        # The clock of the first camera in the scenario is the cycle master's; all others on the bus follow it.
        timer = CycleTimer(DeviceClock(scenario, first, HostNs(config.epoch)).at)
        self._loop = Loop()
        self._bus = Bus(self._loop, train, timer, permitted=config.permitted)
        line = Line(train, timer, self._bus.send, self._bus.reset)
        self._cameras = {
            name: Camera(
                guid_number(guid),
                self._loop,
                line,
                _painter(config, scenario, name),
                FaultPlan(f for f in scenario.faults_of(name) if f.kind not in OF_THE_CAMERA),
                config.signature,
            )
            for name, guid in config.cameras.items()
        }
        self._server = _listen(config.socket)
        self._thread = threading.Thread(target=self._loop.run, name="bus")

    def start(self) -> None:
        """Be there."""
        _play_hardware()
        self._bus.connect(self._cameras)
        self._bus.listen(self._server)
        self._thread.start()

    def stop(self) -> None:
        """Be gone."""
        self._loop.stop()
        self._thread.join(_JOIN_S)
        self._bus.close()
        self._server.close()
        self._loop.close()

    def obey(self, command: Message) -> Message:
        """Carry out a command in the bus's own thread."""
        return self._loop.call(lambda: self._obey(command))

    def _obey(self, command: Message) -> Message:
        answer: Message = {}
        match command:
            case {"command": "inject", "fault": dict() as data}:
                fault = validate(Fault, data, "fault")
                self._bus.camera(fault.camera).inject(fault)
            case {"command": "unplug", "camera": str() as name}:
                self._bus.unplug(name)
            case {"command": "plug", "camera": str() as name}:
                self._bus.plug(name)
            case {"command": "freeze", "camera": str() as name}:
                self._bus.camera(name).freeze()
            case {"command": "thaw", "camera": str() as name}:
                self._bus.camera(name).thaw()
            case {"command": "reset_bus"}:
                self._bus.reset()
            case {"command": "statistics", "camera": str() as name}:
                answer = {"statistics": asdict(self._statistics(self._bus.camera(name)))}
            case {"command": "state"}:
                answer = {"state": self._bus.state()}
            case _:
                raise BadInputError(
                    f"command {command}: give inject, unplug, plug, freeze, thaw, reset_bus, statistics, state or stop"
                )
        return answer

    def _statistics(self, camera: Camera) -> CameraStatistics:
        counters = camera.counters
        return CameraStatistics(
            counters.triggers,
            counters.missed,
            counters.overruns,
            counters.frames,
            counters.packets,
            counters.bytes,
            time.process_time() / len(self._cameras),
            camera.acquiring,
            self._bus.controls(camera),
            dict(counters.last_packets),
        )


def _play_hardware() -> None:
    """Go before ordinary programs where that is allowed: real cameras send in time however busy the computer is."""
    with contextlib.suppress(PermissionError):  # else the emulated ones may be late on a busy machine
        os.setpriority(os.PRIO_PROCESS, 0, _NICENESS)


def _listen(name: str) -> socket.socket:
    """The socket that the shim connects to."""
    server = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    try:
        server.bind(f"\0{name[1:]}" if name.startswith("@") else name)
        server.listen()
    except OSError as error:
        with contextlib.closing(server):
            raise BadInputError(
                f"socket {name} of the emulated FireWire bus: {error.strerror}: choose another name"
            ) from None
    return server


def _painter(config: BusConfig, scenario: Scenario, name: str) -> Painter:
    """Images of the whole sensor, of which Format_0 shows the middle."""
    index = scenario.camera_index(name)
    source: ImageSource = (
        TestPattern(*SENSOR)
        if config.test_pattern
        else CameraView(_behind_vga(scenario), index, *SENSOR, config.rate_hz)
    )
    return Painter(source, SENSOR, index if scenario.stamp else None)


def _behind_vga(scenario: Scenario) -> Scenario:
    """The scenario for the whole sensor, so that its middle 640 columns show what the scenario says of 640 px."""
    cameras = tuple(camera.model_copy(update={"c": camera.c * VGA[0] / SENSOR[0]}) for camera in scenario.cameras)
    return scenario.model_copy(update={"cameras": cameras})
