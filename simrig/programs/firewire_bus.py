"""The process of the emulated FireWire bus with its cameras: `python -m simrig.programs.firewire_bus`."""

import contextlib
import os
import socket
import sys
import threading
import time
from dataclasses import asdict
from typing import Final

from rig.clocks import HostNs
from rig.errors import BadInputError
from simrig.firewire.camera.geometry import SENSOR, VGA
from simrig.firewire.camera.marlin import Camera
from simrig.firewire.camera.sensor import Line
from simrig.firewire.firewire_bus import Bus
from simrig.firewire.isochronous import CycleTimer
from simrig.firewire.loop import Loop
from simrig.images.painter import Painter
from simrig.programs.messages import (
    Answer,
    AskBusState,
    AskStatistics,
    BusCommand,
    BusConfig,
    Done,
    FireWireBus,
    Freeze,
    Inject,
    Plug,
    ResetBus,
    State,
    Statistics,
    Thaw,
    Unplug,
)
from simrig.programs.simulator import run
from simrig.world.conditions.effects import LensErrors
from simrig.world.faults import OF_THE_CAMERA, FaultPlan
from simrig.world.projection import Lens
from simrig.world.pulses import DeviceClock, PulseTrain
from simrig.world.scenario import Scenario, load_scenario

_JOIN_S: Final = 10.0
_NICENESS: Final = -10


class BusProgram:
    """See `simrig.programs.simulator.Program`.

    Raises:
        BadInputError: the scenario is broken or has no such camera, or the socket's name is taken.
    """

    def __init__(self, config: BusConfig) -> None:
        scenario = load_scenario(config.scenario)
        train = PulseTrain(HostNs(config.epoch), config.rate_hz, scenario.pauses)
        # The clock of the first camera is the cycle master's, which all other nodes follow.
        first = scenario.camera_index(next(iter(config.cameras)))
        timer = CycleTimer(DeviceClock(scenario, first, HostNs(config.epoch)).at)
        self._loop = Loop()
        self._bus = Bus(self._loop, train, timer, permitted=config.permitted, cable=config.cable)
        line = Line(train, timer, self._bus.send, self._bus.reset)
        self._cameras = {
            name: Camera(
                int(guid, 16),
                self._loop,
                line,
                _painter(config, scenario, name),
                FaultPlan(f for f in scenario.faults_of(name) if f.kind not in OF_THE_CAMERA),
                config.signature,
                config.deep,
            )
            for name, guid in config.cameras.items()
        }
        self._server = _listen(config.socket)
        self._thread = threading.Thread(target=self._loop.run, name="bus")

    def start(self) -> None:
        """Plug in the cameras and accept programs."""
        _play_hardware()
        self._bus.connect(self._cameras)
        self._bus.listen(self._server)
        self._thread.start()

    def stop(self) -> None:
        """Stop the bus's thread and close its sockets."""
        self._loop.stop()
        self._thread.join(_JOIN_S)
        self._bus.close()
        self._server.close()
        self._loop.close()

    def obey(self, command: BusCommand) -> Answer:
        """Carry out a command in the bus's own thread."""
        return self._loop.call(lambda: self._obey(command))

    def _obey(self, command: BusCommand) -> Answer:
        match command:
            case Inject(fault=fault):
                self._bus.camera(fault.camera).inject(fault)
            case Unplug(camera=name):
                self._bus.unplug(name)
            case Plug(camera=name):
                self._bus.plug(name)
            case Freeze(camera=name):
                self._bus.camera(name).freeze()
            case Thaw(camera=name):
                self._bus.camera(name).thaw()
            case ResetBus():
                self._bus.reset()
            case AskStatistics(camera=name):
                return self._statistics(self._bus.camera(name))
            case AskBusState():
                return State(state=self._bus.state())
        return Done()

    def _statistics(self, camera: Camera) -> Statistics:
        cpu_s = time.process_time() / len(self._cameras)
        controlled = self._bus.controls(camera)
        return Statistics(
            statistics=camera.counters.report(cpu_s=cpu_s, acquiring=camera.acquiring, controlled=controlled)
        )


def _play_hardware() -> None:
    """Take precedence over ordinary programs where allowed: real cameras send in time on a busy computer too."""
    with contextlib.suppress(PermissionError):
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
    """Images of the whole sensor; its middle 640 columns, which Format_0 reads, show what the scenario says."""
    whole = of_whole_sensor(scenario)
    return Painter(whole, scenario.camera_index(name), SENSOR, config.rate_hz, test_pattern=config.test_pattern)


def of_whole_sensor(scenario: Scenario) -> Scenario:
    """The scenario for images as large as the sensor: c and lens of its cameras hold in the middle 640 columns."""
    by = VGA[0] / SENSOR[0]
    cameras = []
    for camera in scenario.cameras:
        lens = LensErrors.model_construct(**asdict(Lens(**camera.lens.model_dump()).scaled(by)))
        cameras.append(camera.model_copy(update={"c": camera.c * by, "lens": lens}))
    return scenario.model_copy(update={"cameras": tuple(cameras)})


def main() -> None:
    """Be a bus until told to stop."""
    sys.exit(run(FireWireBus, BusCommand, lambda first: BusProgram(first.config)))


if __name__ == "__main__":
    main()
