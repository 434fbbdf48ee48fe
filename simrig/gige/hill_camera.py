"""A simulated GigE Vision camera of the hill: one process."""

from rig.clocks import HostNs
from simrig.camera_process import CameraProcess
from simrig.faults import ON_GIGE, Fault
from simrig.gige.config import CameraConfig
from simrig.gige.counters import GigeStatistics
from simrig.hill_camera import Launch


class GigeHillCamera:
    """See `simrig.hill_camera.HillCamera`."""

    kinds = ON_GIGE

    def __init__(self, config: CameraConfig, launch: Launch) -> None:
        self._config, self._launch = config, launch
        self._process: CameraProcess | None = None

    @property
    def pid(self) -> int | None:
        """See `HillCamera`."""
        return self._process.pid if self._process is not None and self._process.alive else None

    @property
    def killed(self) -> bool:
        """See `HillCamera`."""
        return self._process is not None and self._process.killed

    @property
    def frozen(self) -> bool:
        """See `HillCamera`."""
        return self._process is not None and self._process.frozen

    def start(self) -> None:
        """See `HillCamera`."""
        self._process = self._launch("simrig.gige", self._config, f"simulated camera {self._config.name}")

    def await_ready(self) -> None:
        """See `HillCamera`."""
        self._running().await_ready()

    def inject(self, fault: Fault) -> None:
        """See `HillCamera`."""
        self._running().ask({"command": "inject", "fault": fault.model_dump(mode="json")})

    def kill(self) -> None:
        """SIGKILL."""
        self._running().kill()

    def restart(self) -> None:
        """See `HillCamera`."""
        self.kill()
        self.start()
        self.await_ready()

    def freeze(self) -> None:
        """SIGSTOP."""
        self._running().freeze()

    def thaw(self) -> None:
        """SIGCONT."""
        if self.frozen:
            self._running().thaw()

    def statistics(self) -> GigeStatistics:
        """See `HillCamera`."""
        data = self._running().ask({"command": "statistics"})["statistics"]
        data["last_packets"] = {int(pulse): HostNs(moment) for pulse, moment in data["last_packets"].items()}
        return GigeStatistics(**data)

    def begin_stop(self) -> None:
        """See `HillCamera`."""
        if self._process is not None:
            self._process.begin_stop()

    def stop(self) -> None:
        """See `HillCamera`."""
        if self._process is not None:
            self._process.stop()
            self._process = None

    def _running(self) -> CameraProcess:
        assert self._process is not None, "started"  # noqa: S101  (SimulatedHill starts all before it does anything else)
        return self._process
