"""The PTP time that the cameras share, from the readings of their clocks, and the cameras without it."""

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median_low
from typing import Final

from rig.clocks import NS_PER_S, DeviceNs, HostNs
from rig.phrase import Phrase, phrase
from triggering.timeline.pulse_train import CLOCKS_NS

#: The readings of two clocks that agree differ by no more than this, ns.
_AGREE_NS: Final = 2 * CLOCKS_NS


@dataclass(frozen=True, slots=True)
class PtpTime:
    """PTP time against the host's.

    Attributes:
        offset_ns: PTP time minus host time.
        astray: index of each camera whose clock shows another time, and how far it is off, ns.
    """

    offset_ns: int
    astray: tuple[tuple[int, int], ...] = ()

    @classmethod
    def of(cls, offsets_ns: Sequence[int | None]) -> "PtpTime | None":
        """The time that most cameras share.

        Args:
            offsets_ns: device minus host time of each camera; None: not known.

        Returns:
            None: no camera's clock is known.
        """
        known = [offset for offset in offsets_ns if offset is not None]
        if not known:
            return None
        usual = median_low(known)
        off = ((camera, each - usual) for camera, each in enumerate(offsets_ns) if each is not None)
        return cls(usual, tuple((camera, away) for camera, away in off if abs(away) > _AGREE_NS))

    def at(self, host: HostNs) -> DeviceNs:
        """PTP time at a host time."""
        return DeviceNs(host + self.offset_ns)

    def host(self, time: int) -> HostNs:
        """Host time at a PTP time."""
        return HostNs(time - self.offset_ns)

    def words(self, names: Sequence[str]) -> list[Phrase]:
        """Says of each camera that is astray how far it is off, and what to do.

        Args:
            names: of the cameras.
        """
        text = (
            "the PTP clock of {camera} is {seconds} s off those of the others: connect all cameras to one PTP master "
            "and one PTP domain"
        )
        return [
            phrase("action_other_time", text, camera=names[camera], seconds=round(away / NS_PER_S, 3))
            for camera, away in self.astray
        ]


class ScheduledTrain:
    """When to send the commands for whole multiples of the period in PTP time.

    Args:
        period_ns: time between two pulses.
        lead_ns: a command is sent so long before its pulse.
        latest_ns: with less than this left until its pulse a command is not sent: it could come too late.
    """

    def __init__(self, period_ns: int, lead_ns: int, latest_ns: int) -> None:
        self._period_ns, self._lead_ns, self._latest_ns = period_ns, lead_ns, latest_ns
        self._done: int | None = None

    def until_next_ns(self, now: HostNs, ptp: PtpTime) -> int:
        """Time from `now` until the next command is to be sent, ns."""
        return (-(ptp.at(now) + self._lead_ns)) % self._period_ns

    def due(self, now: HostNs, ptp: PtpTime) -> DeviceNs | None:
        """PTP time of the pulse whose command is to be sent now, once for each; None: there is none.

        Only pulses since the first call are due.
        """
        pulse = (ptp.at(now) + self._lead_ns) // self._period_ns
        if self._done is None or pulse < self._done - 1:  # at the beginning, or PTP time was set back
            self._done = pulse
        if pulse <= self._done:
            return None
        self._done = pulse
        time = DeviceNs(pulse * self._period_ns)
        return time if time - ptp.at(now) >= self._latest_ns else None
