"""A simulated GigE Vision camera of the hill: one process."""

from simrig.camera_process import ProcessOwner
from simrig.faults import ON_GIGE, Fault
from simrig.gige.config import CameraConfig
from simrig.gige.counters import GigeStatistics
from simrig.hill_camera import Launch


class GigeHillCamera(ProcessOwner):
    """See `simrig.hill_camera.HillCamera`."""

    kinds = ON_GIGE

    def __init__(self, config: CameraConfig, launch: Launch) -> None:
        super().__init__()
        self._config, self._launch = config, launch

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
        return GigeStatistics.from_json(self._running().ask({"command": "statistics"})["statistics"])
