"""The clock behind the camera's timestamps: free-running, or on the master's time once PTP has settled."""

from dataclasses import dataclass

from rig.clocks import NS_PER_S, HostNs
from rig.pulse import HillPulse
from simrig.gige.registers.register_table import PtpStatus
from simrig.world.pulses import DeviceClock

PTP_SETTLE_NS = NS_PER_S // 2  #: from PtpEnable until the clock is synchronised


@dataclass(frozen=True, slots=True)
class PtpMaster:
    """The PTP master's time as this camera receives it.

    Attributes:
        offset_ns: master's time minus host time, the same for all cameras.
        error_ns: remaining error of this camera's synchronisation.
    """

    offset_ns: int
    error_ns: int


class CameraClock:
    """The camera's clock, in ticks.

    Args:
        free: the clock without PTP.
        master: the time that PTP synchronises it to.
        tick_hz: ticks per second.
    """

    def __init__(self, free: DeviceClock, master: PtpMaster, tick_hz: int) -> None:
        self._free, self._master, self._tick_hz = free, master, tick_hz
        self._zero = 0
        self._settled_at: int | None = None

    def ticks(self, host: HostNs) -> int:
        """Reading of the clock at a host time."""
        return self._device(host) * self._tick_hz // NS_PER_S

    def exposure_ticks(self, host: HostNs, pulse: HillPulse) -> int:
        """Timestamp of the exposure begun at `host` for hill pulse `pulse`, with its jitter."""
        jitter = self._free.at_pulse(host, pulse) - self._free.at(host)
        return (self._device(host) + jitter) * self._tick_hz // NS_PER_S

    def host_of(self, ticks: int) -> HostNs:
        """Host time at which the clock, settled by PTP, shows `ticks`."""
        return HostNs(ticks * NS_PER_S // self._tick_hz - self._master.offset_ns - self._master.error_ns)

    def reset(self, host: HostNs) -> None:
        """Restart the free-running clock from 0."""
        self._zero = self._free.at(host)

    def enable_ptp(self, enable: bool, host: HostNs) -> None:
        """Begin at `host` to settle onto the master's time, or go back to the free-running clock."""
        if not enable:
            self._settled_at = None
        elif self._settled_at is None:
            self._settled_at = host + PTP_SETTLE_NS

    def ptp_status(self, host: HostNs) -> PtpStatus:
        """State of the PTP port."""
        if self._settled_at is None:
            return PtpStatus.DISABLED
        return PtpStatus.SLAVE if host >= self._settled_at else PtpStatus.UNCALIBRATED

    def ptp_offset_ns(self, host: HostNs) -> int:
        """Device time minus the master's time, ns; 0 unless PTP has settled."""
        return self._master.error_ns if self.ptp_status(host) is PtpStatus.SLAVE else 0

    def _device(self, host: HostNs) -> int:
        if self.ptp_status(host) is PtpStatus.SLAVE:
            return host + self._master.offset_ns + self._master.error_ns
        return self._free.at(host) - self._zero
