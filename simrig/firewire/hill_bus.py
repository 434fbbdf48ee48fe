"""The emulated FireWire bus of the hill, as its owner handles it: one process with all its cameras."""

import os
from dataclasses import dataclass
from typing import Any

from simrig.camera_process import ProcessOwner
from simrig.faults import ON_FIREWIRE, Fault
from simrig.firewire import wire
from simrig.firewire.build import shim
from simrig.firewire.config import BusConfig
from simrig.hill_camera import Launch
from simrig.statistics import CameraStatistics


@dataclass(frozen=True, slots=True)
class BusState:
    """The bus as a whole.

    Attributes:
        generation: number of its configuration; every reset makes a new one.
        bandwidth: units that are free in each cycle.
        channels: isochronous channels that are taken.
        nodes: names of the nodes, e.g. fw0 (the computer), fw1.
    """

    generation: int
    bandwidth: int
    channels: tuple[int, ...]
    nodes: tuple[str, ...]


class HillBus(ProcessOwner):
    """The bus's process.

    Args:
        config: what it is told.
        launch: starts it.

    Attributes:
        cameras: the cameras on it, by name.
    """

    def __init__(self, config: BusConfig, launch: Launch) -> None:
        super().__init__()
        self._config, self._launch = config, launch
        self.cameras = {name: FireWireHillCamera(self, name) for name in config.cameras}
        self._ready = False

    @property
    def environment(self) -> dict[str, str]:
        """What a process must have in its environment to see the bus.

        Raises:
            BadInputError: there is no C compiler.
        """
        preload = [str(shim()), *filter(None, [os.environ.get("LD_PRELOAD")])]
        return {"LD_PRELOAD": " ".join(preload), wire.VARIABLE: self._config.socket}

    def start(self) -> None:
        """Begin to start it, once."""
        if self._process is None:
            self._process = self._launch("simrig.firewire", self._config, "the emulated FireWire bus")

    def ask(self, command: str, **arguments: Any) -> dict[str, Any]:
        """Send a command and wait for the answer."""
        return self._running().ask({"command": command, **arguments})

    def await_ready(self) -> None:
        """Wait until it is there, once."""
        if not self._ready:
            self._running().await_ready()
            self._ready = True

    def reset(self) -> None:
        """Reset the bus."""
        self.ask("reset_bus")

    def state(self) -> BusState:
        """The bus as a whole."""
        state = self.ask("state")["state"]
        return BusState(state["generation"], state["bandwidth"], tuple(state["channels"]), tuple(state["nodes"]))

    def statistics(self, camera: str) -> CameraStatistics:
        """What one of its cameras did."""
        return CameraStatistics.from_json(self.ask("statistics", camera=camera)["statistics"])


class FireWireHillCamera:
    """One camera on the bus; see `simrig.hill_camera.HillCamera`. To kill it is to unplug it."""

    kinds = ON_FIREWIRE

    def __init__(self, bus: HillBus, name: str) -> None:
        self._bus, self._name = bus, name
        self.killed = self.frozen = False

    @property
    def pid(self) -> int | None:
        """Of the bus; None while the camera is unplugged."""
        return None if self.killed else self._bus.pid

    def start(self) -> None:
        """See `HillCamera`."""
        self._bus.start()

    def await_ready(self) -> None:
        """See `HillCamera`."""
        self._bus.await_ready()

    def inject(self, fault: Fault) -> None:
        """See `HillCamera`."""
        self._bus.ask("inject", fault=fault.model_dump(mode="json"))

    def kill(self) -> None:
        """Unplug it."""
        self._bus.ask("unplug", camera=self._name)
        self.killed, self.frozen = True, False

    def restart(self) -> None:
        """Unplug it if need be, and plug it in."""
        self._bus.ask("plug", camera=self._name)
        self.killed = self.frozen = False

    def freeze(self) -> None:
        """See `HillCamera`."""
        self._bus.ask("freeze", camera=self._name)
        self.frozen = True

    def thaw(self) -> None:
        """See `HillCamera`."""
        if self.frozen:
            self._bus.ask("thaw", camera=self._name)
            self.frozen = False

    def statistics(self) -> CameraStatistics:
        """See `HillCamera`."""
        return self._bus.statistics(self._name)

    def begin_stop(self) -> None:
        """See `HillCamera`."""
        self._bus.begin_stop()

    def stop(self) -> None:
        """See `HillCamera`."""
        self._bus.stop()
