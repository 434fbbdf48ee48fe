"""The simulated hill as one in-process camera sees it: joins `simrig` to the back end `capture.sim_camera`."""

import numpy as np
from numpy.typing import NDArray

from capture.sim_camera import Exposure
from rig.clocks import DeviceNs, HostNs
from rig.errors import BadInputError
from rig.settings import RigSettings
from simrig.device_clock import DeviceClock
from simrig.faults import Fault, FaultKind, FaultPlan
from simrig.images.view import CameraView
from simrig.pulse_train import PulseTrain
from simrig.world.scenario import load_scenario

_EXPOSURES = {
    FaultKind.MISSED_PULSE: Exposure.MISSED,
    FaultKind.OVERRUN: Exposure.MISSED,
    FaultKind.LOST_FRAME: Exposure.LOST,
    FaultKind.LOST_PACKETS: Exposure.DAMAGED,
    FaultKind.LOST_LEADER: Exposure.DAMAGED,
    FaultKind.DAMAGED_FRAME: Exposure.DAMAGED,
    FaultKind.FROZEN: Exposure.MISSED,
    FaultKind.RESTART: Exposure.DEAD,
}


class SimScene:
    """One camera of a scenario; see `capture.sim_camera.Scene`."""

    def __init__(self, rig: RigSettings, index: int, epoch: HostNs) -> None:
        if rig.simulation is None:
            raise BadInputError('backend "sim" needs a [simulation] table in the rig file: add a scenario')
        scenario = load_scenario(rig.simulation.scenario)
        settings = rig.cameras[index]
        camera = scenario.camera_index(settings.name)
        self._train = PulseTrain(epoch, rig.trigger.rate_hz, scenario.pauses)
        self._view = CameraView(scenario, camera, settings.region.width, settings.region.height, rig.trigger.rate_hz)
        self._clock = DeviceClock(scenario, camera, epoch)
        self._plan = FaultPlan(scenario.faults_of(settings.name))
        self._dark_until = HostNs(0)

    def inject(self, fault: Fault) -> None:
        """Add a fault while the camera runs."""
        self._plan.inject(fault)

    def next_pulse(self, after: HostNs) -> int:
        """Index of the first pulse strictly later than `after`."""
        return self._train.next_index(after)

    def pulse_time(self, pulse: int) -> HostNs:
        """When the pulse fires."""
        return self._train.time(pulse)

    def device_time(self, host: HostNs, pulse: int | None = None) -> DeviceNs:
        """The camera's own clock; for a pulse, with the jitter of its exposure."""
        return self._clock.at(host) if pulse is None else self._clock.at_pulse(host, pulse)

    def exposure(self, pulse: int) -> Exposure:
        """What the scenario makes of the pulse."""
        time = self._train.time(pulse)
        faults = self._plan.take(pulse)
        for fault in faults:
            if fault.kind in {FaultKind.FROZEN, FaultKind.RESTART}:
                self._dark_until = max(self._dark_until, HostNs(time + fault.duration_ns))
        if faults:
            # Packets that the camera resends arrive after all; a slow link still delivers; there is no bus to reset.
            harmful = [f for f in faults if f.kind in _EXPOSURES and not (f.packets and f.resend)]
            return _EXPOSURES[harmful[0].kind] if harmful else Exposure.OK
        return Exposure.MISSED if time < self._dark_until else Exposure.OK

    def render_into(self, out: NDArray[np.uint8], pulse: int) -> None:
        """Draw the frame, shape (rows, columns)."""
        self._view.render_into(out, pulse)
