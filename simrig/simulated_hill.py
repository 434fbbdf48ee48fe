"""The simulated hill's cameras and their faults: GigE Vision, one process each; FireWire, one process for the bus."""

import os
import threading
import uuid
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Self

from pydantic import BaseModel

from rig.clocks import HostNs, UtcAnchor, host_now
from rig.errors import BadInputError
from rig.rigfile import validate
from simrig.camera_process import START_S, CameraProcess
from simrig.faults import OF_THE_CAMERA, Fault, FaultKind
from simrig.firewire.config import BusConfig, Signature
from simrig.firewire.hill_bus import BusState, HillBus
from simrig.gige.config import CameraConfig
from simrig.gige.hill_camera import GigeHillCamera
from simrig.hill_camera import HillCamera
from simrig.pulse_train import PulseTrain
from simrig.statistics import CameraStatistics
from simrig.timetable import Timetable
from simrig.world.scenario import load_scenario


class SimulatedHill:
    """Simulated cameras; a context manager, to be entered once, that starts and stops them.

    Args:
        scenario: scenario file.
        addresses: IPv4 address per GigE Vision camera, in the scenario's names.
        rate_hz: rate of the hill's trigger pulses.
        firewire: GUID (16 hexadecimal digits) per FireWire camera, in the scenario's names.
        epoch: host time of hill pulse 0; None: now.
        permitted: whether programs may open the FireWire nodes.
        signature: byte order in which FireWire cameras sign their images; "none": their firmware cannot.
        test_pattern: show a plain pattern instead of the hill.

    The others are for GigE Vision:
        size: width and height of the sensors, px.
        prerendered: render so many images once and only stamp them anew (load tests); 0: render every pulse.
        link_mbit_s: rate of each camera's network cable, 0: as fast as possible.
        first_block_id: block id of the first frame after each start of acquisition.
        tick_hz: ticks of the device clocks per second.
        resend: whether the cameras can send lost packets again.
        broadcast: broadcast address at which discovery is answered too, e.g. 127.255.255.255.

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
        permitted: bool = True,
        signature: Signature = "big",
        epoch: HostNs | None = None,
        size: tuple[int, int] = (640, 480),
        prerendered: int = 0,
        link_mbit_s: float = 1000.0,
        first_block_id: int = 1,
        tick_hz: int = 1_000_000_000,
        resend: bool = True,
        test_pattern: bool = False,
        broadcast: str | None = None,
    ) -> None:
        truth = load_scenario(scenario)
        firewire = firewire or {}
        for name in (*addresses, *firewire):
            truth.camera_index(name)
        epoch = host_now() if epoch is None else epoch
        common = {
            "scenario": scenario.resolve(), "rate_hz": rate_hz, "epoch": epoch, "test_pattern": test_pattern,
        }  # fmt: skip
        gige = common | {
            "width": size[0], "height": size[1], "prerendered": prerendered, "link_mbit_s": link_mbit_s,
            "first_block_id": first_block_id, "tick_hz": tick_hz, "resend": resend, "broadcast": broadcast,
            "ptp_offset_ns": UtcAnchor.take().offset_ns,
        }  # fmt: skip
        bus = common | {"cameras": dict(firewire), "permitted": permitted, "signature": signature}
        self._bus = self._make_bus(bus) if firewire else None
        self._cameras = self._make_gige(addresses, gige)
        if self._bus is not None:
            self._cameras |= self._bus.cameras
        self.train = PulseTrain(epoch, rate_hz, truth.pauses)
        for fault in truth.faults:
            self._check_kind(fault)
        self._planned = [
            fault for fault in truth.faults if fault.camera in self._cameras and fault.kind in OF_THE_CAMERA
        ]
        self._lock = threading.RLock()  # the timetable's thread and our caller's both command the processes
        self._timetable = Timetable()
        # Camera processes end with the thread that started them, so one that lives as long as we do starts them all.
        self._starter = ThreadPoolExecutor(max_workers=1, thread_name_prefix="camera starter")

    def __enter__(self) -> Self:
        """Start all cameras.

        Raises:
            BadInputError: an address is in use or none of this machine's.
            ProcessDiedError: a camera process does not come up.
        """
        with ExitStack() as on_failure:
            on_failure.callback(self.stop)
            for camera in self._cameras.values():
                camera.start()
            for camera in self._cameras.values():
                camera.await_ready()
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
        """What a process needs in its environment to see the FireWire cameras.

        Raises:
            BadInputError: there are FireWire cameras, but no C compiler for the shim.
        """
        return self._bus.environment if self._bus is not None else {}

    @property
    def pids(self) -> dict[str, int]:
        """Process ids of the cameras that are alive."""
        with self._lock:
            return {name: camera.pid for name, camera in self._cameras.items() if camera.pid is not None}

    def inject(self, fault: Fault) -> None:
        """Let something go wrong.

        Raises:
            BadInputError: no such camera, it is dead or frozen, it has no such fault, or the fault's pulses are past.
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
        """End a camera by force, as if its power were cut."""
        with self._lock:
            self._camera(camera).kill()

    def restart(self, camera: str) -> None:
        """End a camera if it is alive, and start it with its default settings.

        Raises:
            BadInputError: its address has been taken meanwhile.
            ProcessDiedError: it does not come up.
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
            self._firewire().reset()

    def bus_state(self) -> BusState:
        """The FireWire bus as a whole.

        Raises:
            BadInputError: there is none.
        """
        with self._lock:
            return self._firewire().state()

    def statistics(self) -> dict[str, CameraStatistics]:
        """What each camera did since its process began; killed and frozen ones are left out.

        Raises:
            ProcessDiedError: a camera process ended by itself.
        """
        with self._lock:
            running = {name: camera for name, camera in self._cameras.items() if not (camera.killed or camera.frozen)}
            return {name: camera.statistics() for name, camera in running.items()}

    def stop(self) -> None:
        """Stop all cameras; by force after a while."""
        self._timetable.stop()
        with self._lock:
            for camera in self._cameras.values():
                camera.begin_stop()
            for camera in self._cameras.values():
                camera.stop()
        self._starter.shutdown()

    def _make_gige(self, addresses: Mapping[str, str], settings: dict[str, object]) -> dict[str, HillCamera]:
        cameras: dict[str, HillCamera] = {}
        for name, address in addresses.items():
            config = validate(CameraConfig, {"name": name, "address": address, **settings}, f"simulated camera {name}")
            cameras[name] = GigeHillCamera(config, self._launch)
        return cameras

    def _make_bus(self, settings: dict[str, object]) -> HillBus:
        name = f"@svev-firewire-{os.getpid()}-{uuid.uuid4().hex[:8]}"
        config = validate(BusConfig, {"socket": name, **settings}, "emulated FireWire bus")
        return HillBus(config, self._launch)

    def _launch(self, module: str, config: BaseModel, what: str) -> CameraProcess:
        return self._starter.submit(CameraProcess, module, config, what).result(START_S)

    def _camera(self, name: str) -> HillCamera:
        if name not in self._cameras:
            raise BadInputError(f'no camera "{name}" runs here; name one of {", ".join(self._cameras)}')
        return self._cameras[name]

    def _firewire(self) -> HillBus:
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
        """Plan a fault that befalls the process as a whole."""
        pulse = self.train.next_index(host_now()) if fault.at_pulse is None else fault.at_pulse
        begin = self.train.time(pulse)
        if begin < host_now():
            raise BadInputError(f"fault {fault.kind} at pulse {pulse}: that is past; name a later one")
        end = HostNs(begin + fault.duration_ns)
        camera = fault.camera
        steps: tuple[Callable[[str], None], Callable[[str], None]] = (
            (self.freeze, self.thaw) if fault.kind is FaultKind.FROZEN else (self.kill, self.restart)
        )
        for moment, step in zip((begin, end), steps, strict=True):
            self._timetable.add(moment, partial(step, camera))
