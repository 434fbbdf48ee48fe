"""The simulated hill's cameras on the network: one process per camera, faults included."""

import threading
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Self

from rig.clocks import HostNs, UtcAnchor, host_now
from rig.errors import BadInputError
from rig.rigfile import validate
from simrig.camera_process import START_S, CameraProcess
from simrig.faults import Fault, FaultKind
from simrig.gige.camera import OF_THE_PROCESS
from simrig.gige.config import CameraConfig
from simrig.gige.counters import CameraStatistics
from simrig.pulse_train import PulseTrain
from simrig.timetable import Timetable
from simrig.world.scenario import load_scenario


class SimulatedHill:
    """Simulated GigE Vision cameras; a context manager, to be entered once, that starts and stops them.

    Args:
        scenario: scenario file.
        addresses: IPv4 address per camera, in the scenario's names.
        rate_hz: rate of the hill's trigger pulses.
        epoch: host time of hill pulse 0; None: now.
        size: width and height of the sensors, px.
        prerendered: render so many images once and only stamp them anew (load tests); 0: render every pulse.
        link_mbit_s: rate of each camera's network cable, 0: as fast as possible.
        first_block_id: block id of the first frame after each start of acquisition.
        tick_hz: ticks of the device clocks per second.
        resend: whether the cameras can send lost packets again.
        test_pattern: show a plain pattern instead of the hill.
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
        for name in addresses:
            truth.camera_index(name)
        epoch = host_now() if epoch is None else epoch
        common = {
            "scenario": scenario.resolve(), "rate_hz": rate_hz, "epoch": epoch, "width": size[0], "height": size[1],
            "prerendered": prerendered, "link_mbit_s": link_mbit_s, "first_block_id": first_block_id,
            "tick_hz": tick_hz, "resend": resend, "test_pattern": test_pattern, "broadcast": broadcast,
            "ptp_offset_ns": UtcAnchor.take().offset_ns,
        }  # fmt: skip
        self._configs = {
            name: validate(CameraConfig, {"name": name, "address": address, **common}, f"simulated camera {name}")
            for name, address in addresses.items()
        }
        self.train = PulseTrain(epoch, rate_hz, truth.pauses)
        self._planned = [fault for fault in truth.faults if fault.camera in addresses and fault.kind in OF_THE_PROCESS]
        self._processes: dict[str, CameraProcess] = {}
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
            for name in self._configs:
                self._start(name)
            for process in self._processes.values():
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
    def pids(self) -> dict[str, int]:
        """Process ids of the cameras that are alive."""
        with self._lock:
            return {name: process.pid for name, process in self._processes.items() if process.alive}

    def inject(self, fault: Fault) -> None:
        """Let something go wrong.

        Raises:
            BadInputError: no such camera, it is dead or frozen, or the fault's pulses are past.
        """
        with self._lock:
            process = self._answering(fault.camera)
            if fault.kind in OF_THE_PROCESS:
                self._schedule(fault)
            else:
                process.ask({"command": "inject", "fault": fault.model_dump(mode="json")})

    def kill(self, camera: str) -> None:
        """End a camera's process by force, as if its power were cut."""
        with self._lock:
            self._process(camera).kill()

    def restart(self, camera: str) -> None:
        """End a camera's process if it is alive, and start it with its default settings.

        Raises:
            BadInputError: its address has been taken meanwhile.
            ProcessDiedError: it does not come up.
        """
        with self._lock:
            self.kill(camera)
            self._start(camera)
            self._processes[camera].await_ready()

    def freeze(self, camera: str) -> None:
        """Let a camera answer nothing and send nothing (SIGSTOP)."""
        with self._lock:
            self._process(camera).freeze()

    def thaw(self, camera: str) -> None:
        """Let a frozen camera go on."""
        with self._lock:
            process = self._process(camera)
            if process.frozen:
                process.thaw()

    def statistics(self) -> dict[str, CameraStatistics]:
        """What each camera did since its process began; killed and frozen ones are left out.

        Raises:
            ProcessDiedError: a camera process ended by itself.
        """
        with self._lock:
            running = {name: p for name, p in self._processes.items() if not (p.killed or p.frozen)}
            return {name: _statistics(process) for name, process in running.items()}

    def stop(self) -> None:
        """Stop all cameras; by force after a while."""
        self._timetable.stop()
        with self._lock:
            for process in self._processes.values():
                process.begin_stop()
            for process in self._processes.values():
                process.stop()
            self._processes.clear()
        self._starter.shutdown()

    def _start(self, camera: str) -> None:
        self._processes[camera] = self._starter.submit(CameraProcess, self._configs[camera]).result(START_S)

    def _process(self, camera: str) -> CameraProcess:
        if camera not in self._processes:
            raise BadInputError(f'no camera "{camera}" runs here; name one of {", ".join(self._configs)}')
        return self._processes[camera]

    def _answering(self, camera: str) -> CameraProcess:
        process = self._process(camera)
        if process.frozen or process.killed:
            raise BadInputError(f"camera {camera} is {'frozen: thaw' if process.frozen else 'dead: restart'} it first")
        return process

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


def _statistics(process: CameraProcess) -> CameraStatistics:
    data = process.ask({"command": "statistics"})["statistics"]
    data["last_packets"] = {int(pulse): HostNs(moment) for pulse, moment in data["last_packets"].items()}
    return CameraStatistics(**data)
