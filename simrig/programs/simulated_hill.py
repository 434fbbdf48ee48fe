"""Starts and stops the simulated cameras of a hill on both buses, and carries out their faults."""

import os
import threading
import uuid
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from typing import Final, Self, TypedDict, Unpack

from rig.clocks import NS_PER_S, HostNs, UtcAnchor, host_now
from rig.errors import BadInputError
from rig.settings.strict_toml import validate
from rig.transport.message import Message
from rig.transport.process_table import Child, ProcessSpec
from simrig.firewire.bus_state import BusState
from simrig.firewire.camera.advanced import Signature
from simrig.firewire.camera.geometry import MARLIN, Deep
from simrig.firewire.host import wire
from simrig.firewire.host.build import shim
from simrig.gige.configuration import CameraConfig
from simrig.gige.registers.makers import Maker
from simrig.programs.cameras import START_S, CameraProcess, HillCamera
from simrig.programs.messages import AskBusState, BusConfig, Done, FireWireBus, GigeCamera, ResetBus, State
from simrig.world.cable import CableEnd
from simrig.world.faults import OF_THE_CAMERA, Fault, FaultKind
from simrig.world.pulses import PulseTrain
from simrig.world.scenario import load_scenario
from simrig.world.statistics import CameraStatistics

_STOP_S: Final = 30.0


class GigeOptions(TypedDict, total=False):
    """Options of all GigE Vision cameras; `CameraConfig` describes them and has their defaults."""

    width: int
    height: int
    prerendered: int
    link_mbit_s: float
    first_block_id: int
    tick_hz: int
    resend: bool
    maker: Maker
    broadcast: str | None
    line: CableEnd | None


class SimulatedHill:
    """Simulated cameras: one process per GigE Vision camera, one for the FireWire bus with all its cameras.

    A context manager that starts and stops them; it can be entered once.

    Args:
        scenario: scenario file.
        addresses: IPv4 address of each GigE Vision camera, by its name in the scenario.
        rate_hz: rate of the hill's trigger pulses.
        firewire: GUID (16 hexadecimal digits) of each FireWire camera, by its name in the scenario.
        epoch: host time of hill pulse 0; None: now.
        test_pattern: show a plain pattern instead of the hill.
        permitted: whether programs may open the FireWire nodes.
        cable: whether the hill's pulses reach the inputs of the FireWire cameras.
        signature: byte order in which FireWire cameras sign their images; "none": their firmware cannot.
        deep: how FireWire cameras send pixels of more than 8 bits.
        gige: options of the GigE Vision cameras.

    Raises:
        BadInputError: the scenario is broken or has no such camera, or an option is out of range.
    """

    def __init__(
        self,
        scenario: Path,
        addresses: Mapping[str, str],
        rate_hz: float,
        *,
        firewire: Mapping[str, str] | None = None,
        epoch: HostNs | None = None,
        test_pattern: bool = False,
        permitted: bool = True,
        cable: bool = True,
        signature: Signature = "big",
        deep: Deep = MARLIN,
        **gige: Unpack[GigeOptions],
    ) -> None:
        truth = load_scenario(scenario)
        firewire = firewire or {}
        for name in (*addresses, *firewire):
            truth.camera_index(name)
        epoch = host_now() if epoch is None else epoch
        common: dict[str, object] = {
            "scenario": scenario.resolve(), "rate_hz": rate_hz, "epoch": epoch, "test_pattern": test_pattern,
        }  # fmt: skip
        camera = {**common, "ptp_offset_ns": UtcAnchor.take().offset_ns, **gige}
        self._socket = f"@svev-firewire-{os.getpid()}-{uuid.uuid4().hex[:8]}"
        bus = common | {
            "cameras": dict(firewire), "socket": self._socket, "permitted": permitted, "signature": signature,
            "cable": cable, "deep": deep,
        }  # fmt: skip
        self._bus: CameraProcess | None = None
        self._cameras: dict[str, HillCamera] = {}
        self._processes: list[CameraProcess] = []
        for name, address in addresses.items():
            what = f"simulated camera {name}"
            config = validate(CameraConfig, {"name": name, "address": address, **camera}, what)
            process = self._process(what, "simrig.programs.gige_camera", GigeCamera(config=config))
            self._cameras[name] = HillCamera(name, process, on_bus=False)
        if firewire:
            first = FireWireBus(config=validate(BusConfig, bus, "emulated FireWire bus"))
            self._bus = self._process("the emulated FireWire bus", "simrig.programs.firewire_bus", first)
            self._cameras |= {name: HillCamera(name, self._bus, on_bus=True) for name in firewire}
        self.train = PulseTrain(epoch, rate_hz, truth.pauses)
        for fault in truth.faults:
            self._check_kind(fault)
        self._planned = [
            fault for fault in truth.faults if fault.camera in self._cameras and fault.kind in OF_THE_CAMERA
        ]
        self._lock = threading.RLock()  # threads of scheduled faults and our caller's both command the processes
        self._stopping = threading.Event()
        self._scheduled: list[threading.Thread] = []
        # The kernel kills camera processes when the thread that started them ends: this one lives as long as we do.
        self._starter = ThreadPoolExecutor(max_workers=1, thread_name_prefix="camera starter")

    def __enter__(self) -> Self:
        """Start all cameras.

        Raises:
            BadInputError: an address is in use or none of this machine's.
            ProcessDiedError: a camera process does not become ready.
        """
        with ExitStack() as on_failure:
            on_failure.callback(self.stop)
            for process in self._processes:
                process.start()
            for process in self._processes:
                process.await_ready()
            for fault in self._planned:
                if fault.at_pulse is None or self.train.time(fault.at_pulse) > host_now():
                    self._schedule(fault)
            on_failure.pop_all()
        return self

    def __exit__(self, *error: object) -> None:
        """Stop all cameras."""
        self.stop()

    @property
    def environment(self) -> dict[str, str]:
        """Environment variables that a process needs to see the FireWire cameras.

        Raises:
            BadInputError: there are FireWire cameras, but no C compiler for the shim.
        """
        if self._bus is None:
            return {}
        preload = [str(shim()), *filter(None, [os.environ.get("LD_PRELOAD")])]
        return {"LD_PRELOAD": " ".join(preload), wire.VARIABLE: self._socket}

    @property
    def pids(self) -> dict[str, int]:
        """Process ids of the living cameras, by name."""
        with self._lock:
            return {name: camera.pid for name, camera in self._cameras.items() if camera.pid is not None}

    def inject(self, fault: Fault) -> None:
        """Let a camera have a fault.

        Raises:
            BadInputError: there is no such camera, it is dead or frozen or cannot have it, or the pulses are past.
        """
        with self._lock:
            camera = self._camera(fault.camera)
            self._check_kind(fault)
            if camera.frozen or camera.killed:
                state = "frozen: thaw" if camera.frozen else "dead: restart"
                raise BadInputError(f"camera {fault.camera} is {state} it first")
            if fault.kind in OF_THE_CAMERA:
                self._schedule(fault)
            else:
                camera.inject(fault)

    def kill(self, camera: str) -> None:
        """Cut a camera's power."""
        with self._lock:
            self._camera(camera).kill()

    def restart(self, camera: str) -> None:
        """Kill a camera if it is alive, and start it with its default settings.

        Raises:
            BadInputError: its address has been taken meanwhile.
            ProcessDiedError: it does not become ready.
        """
        with self._lock:
            self._camera(camera).restart()

    def freeze(self, camera: str) -> None:
        """Let a camera answer nothing and send nothing."""
        with self._lock:
            self._camera(camera).freeze()

    def thaw(self, camera: str) -> None:
        """Let a frozen camera go on."""
        with self._lock:
            self._camera(camera).thaw()

    def reset_bus(self) -> None:
        """Reset the FireWire bus.

        Raises:
            BadInputError: there is none.
        """
        with self._lock:
            self._firewire().ask(ResetBus(), Done)

    def bus_state(self) -> BusState:
        """State of the FireWire bus as a whole.

        Raises:
            BadInputError: there is none.
        """
        with self._lock:
            return self._firewire().ask(AskBusState(), State).state

    def statistics(self) -> dict[str, CameraStatistics]:
        """What each camera did since its process began; without killed and frozen ones.

        Raises:
            ProcessDiedError: a camera process ended by itself.
        """
        with self._lock:
            running = {name: camera for name, camera in self._cameras.items() if not (camera.killed or camera.frozen)}
            return {name: camera.statistics() for name, camera in running.items()}

    def stop(self) -> None:
        """Stop all cameras; by force after a while."""
        with self._lock:
            self._stopping.set()
        for thread in self._scheduled:
            thread.join(_STOP_S)
        with self._lock:
            for process in self._processes:
                process.begin_stop()
            for process in self._processes:
                process.stop()
        self._starter.shutdown()

    def _process(self, name: str, module: str, config: Message) -> CameraProcess:
        process = CameraProcess(name, module, config, self._launch)
        self._processes.append(process)
        return process

    def _launch(self, spec: ProcessSpec) -> Child:
        return self._starter.submit(Child, spec).result(START_S)

    def _camera(self, name: str) -> HillCamera:
        if name not in self._cameras:
            raise BadInputError(f'no camera "{name}" runs here; name one of {", ".join(self._cameras)}')
        return self._cameras[name]

    def _firewire(self) -> CameraProcess:
        if self._bus is None:
            raise BadInputError("no camera is on FireWire here: name one in the rig file")
        return self._bus

    def _check_kind(self, fault: Fault) -> None:
        camera = self._cameras.get(fault.camera)
        if camera is not None and fault.kind not in camera.kinds:
            raise BadInputError(
                f"fault {fault.kind} cannot befall camera {fault.camera} on its bus; give one of "
                + ", ".join(sorted(camera.kinds))
            )

    def _schedule(self, fault: Fault) -> None:
        """Start a thread that carries out a fault of the camera as a whole."""
        pulse = self.train.next_index(host_now()) if fault.at_pulse is None else fault.at_pulse
        begin = self.train.time(pulse)
        if begin < host_now():
            raise BadInputError(f"fault {fault.kind} at pulse {pulse}: that is past; name a later one")
        if not self._stopping.is_set():
            thread = threading.Thread(target=self._carry_out, args=(fault, begin), name=f"fault of {fault.camera}")
            self._scheduled.append(thread)
            thread.start()

    def _carry_out(self, fault: Fault, begin: HostNs) -> None:
        """Freeze or kill a camera at `begin`, and undo it after the fault's duration."""
        freezes = fault.kind is FaultKind.FROZEN
        first, then = (self.freeze, self.thaw) if freezes else (self.kill, self.restart)
        for moment, step in ((begin, first), (HostNs(begin + fault.duration_ns), then)):
            if self._stopping.wait(max(0, moment - host_now()) / NS_PER_S):
                return
            step(fault.camera)
