"""The simulated hill as one camera of the back end "sim" sees it, inside the grabber process."""

import numpy as np
from numpy.typing import NDArray

from rig.clocks import DeviceNs, HostNs
from rig.errors import BadInputError
from rig.frame import FrameStatus
from rig.pulse import HillPulse
from rig.settings.model import RigSettings
from simrig.images.packing import Packing
from simrig.images.view import CameraView
from simrig.world.cable import Cable, cable_end
from simrig.world.faults import Fault, FaultKind, FaultPlan
from simrig.world.pulses import DeviceClock, PulseTrain
from simrig.world.scenario import load_scenario

_EXPOSURES = {
    FaultKind.MISSED_PULSE: FrameStatus.MISSED,
    FaultKind.OVERRUN: FrameStatus.MISSED,
    FaultKind.LOST_FRAME: FrameStatus.LOST,
    FaultKind.LOST_PACKETS: FrameStatus.DAMAGED,
    FaultKind.LOST_LEADER: FrameStatus.DAMAGED,
    FaultKind.DAMAGED_FRAME: FrameStatus.DAMAGED,
    FaultKind.FROZEN: FrameStatus.MISSED,
    FaultKind.RESTART: FrameStatus.ABSENT,
}


class SimScene:
    """One camera of a scenario: implements `capture.sim.camera.Scene`.

    Raises:
        BadInputError: the rig has no scenario, or the scenario no such camera.
    """

    def __init__(self, rig: RigSettings, index: int, epoch: HostNs) -> None:
        if rig.simulation is None:
            raise BadInputError('backend "sim" needs a [simulation] table in the rig file: add a scenario')
        scenario = load_scenario(rig.simulation.scenario)
        settings = rig.cameras[index]
        camera = scenario.camera_index(settings.name)
        self._train = PulseTrain(epoch, rig.trigger.rate_hz, scenario.pauses)
        self._since = HostNs(-1)
        self._end = cable_end(rig.trigger)
        self._cable: Cable | None = None
        region, held = settings.region, settings.format.pixels
        self._shape = (region.height, region.width)
        self._view = CameraView(scenario, camera, region.width, region.height, rig.trigger.rate_hz, bits=held.bits)
        self._frame = np.zeros(self._shape, held.dtype)
        self._packing = None if settings.pixel_format == "Mono8" else Packing(settings.pixel_format)
        self._clock = DeviceClock(scenario, camera, epoch)
        self._plan = FaultPlan(scenario.faults_of(settings.name))
        self._dark_until = HostNs(0)

    def inject(self, fault: Fault) -> None:
        """Add a fault while the camera runs."""
        self._plan.inject(fault)

    def start(self, after: HostNs) -> None:
        """Let the pulses later than `after` reach the camera: those of the emulated chip's line, or the hill's."""
        self.stop()
        self._since = after
        self._cable = None if self._end is None else Cable.plugged(self._end)

    def next_pulse(self, until: HostNs) -> tuple[HillPulse, HostNs] | None:
        """Number and time of the next pulse that reaches the camera; None: there is none up to a time."""
        if self._cable is not None:
            return self._next_edge(self._cable, until)
        pulse = self._train.next_index(self._since)
        time = self._train.time(pulse)
        if time > until:
            return None
        self._since = time
        return pulse, time

    def stop(self) -> None:
        """Let no pulse reach the camera any more."""
        if self._cable is not None:
            self._cable.close()
            self._cable = None

    def _next_edge(self, cable: Cable, until: HostNs) -> tuple[HillPulse, HostNs] | None:
        while (edge := cable.next_edge(until)) is not None:
            pulse = self._train.nearest(edge.time)
            if edge.active and pulse is not None:  # while the hill pauses, the cable is out
                return pulse, edge.time
        return None

    def device_time(self, host: HostNs, pulse: int | None = None) -> DeviceNs:
        """The camera's own clock; for a pulse, with the jitter of its exposure."""
        return self._clock.at(host) if pulse is None else self._clock.at_pulse(host, HillPulse(pulse))

    def exposure(self, pulse: int) -> FrameStatus:
        """What becomes of the pulse, by the faults of the scenario."""
        time = self._train.time(HillPulse(pulse))
        faults = self._plan.take(HillPulse(pulse))
        for fault in faults:
            if fault.kind in {FaultKind.FROZEN, FaultKind.RESTART}:
                self._dark_until = max(self._dark_until, HostNs(time + fault.duration_ns))
        if faults:
            # Resent packets arrive after all, a slow link still delivers, and there is no bus to reset.
            harmful = [f for f in faults if f.kind in _EXPOSURES and not (f.packets and f.resend)]
            return _EXPOSURES[harmful[0].kind] if harmful else FrameStatus.OK
        return FrameStatus.MISSED if time < self._dark_until else FrameStatus.OK

    def render_into(self, out: NDArray[np.uint8], pulse: int) -> None:
        """Write the bytes of the frame as the camera sends them, shape (bytes,)."""
        if self._packing is None:
            self._view.render_into(out.reshape(self._shape), HillPulse(pulse))
        else:
            self._view.render_into(self._frame, HillPulse(pulse))
            self._packing.pack(self._frame, out)
