"""Which pulses belong to a recording, by their times and by how many it has."""

from dataclasses import dataclass
from typing import Final

from rig.clocks import NS_PER_S, HostNs
from rig.transport.recorder_commands import StartRecording
from triggering.pairing.pairer import ClosedPulse

#: A pulse generator may be slower than the rig file says by this share: the recording still gets all its pulses.
_SLOW: Final = 0.01


@dataclass(slots=True)
class Span:
    """The first and the last pulse of a recording; goes on from log to log.

    Attributes:
        commanded: when the command to start came.
        begin: time of the first pulse that may belong to the recording; may be before `commanded`.
        end: pulses after this time do not belong to it; None: it goes on until it is stopped.
        wanted: it ends when it has so many pulses since the command; None: however many.
        counted: pulses since the command that were handed to a log.
        stopped: whether somebody has ended it.
        over: whether its last pulse was handed to a log.
    """

    commanded: HostNs
    begin: HostNs
    end: HostNs | None = None
    wanted: int | None = None
    counted: int = 0
    stopped: bool = False
    over: bool = False

    @classmethod
    def ordered(cls, order: StartRecording, period_ns: int, now: HostNs) -> "Span":
        """The span of a new recording.

        Args:
            order: what to record.
            period_ns: nominal time between two pulses.
            now: when the order came.
        """
        given, back = now if order.commanded is None else order.commanded, order.preroll_s
        commanded = given if order.goes_on is None else order.goes_on.commanded
        span = cls(commanded, HostNs(0 if back is None else commanded - round(back * NS_PER_S)), wanted=order.pulses)
        if order.seconds is not None:
            # If the pulses are counted, the clock only ends a recording whose pulses come too slowly or stop coming.
            grace = 0 if order.pulses is None else round(order.seconds * NS_PER_S * _SLOW) + 2 * period_ns
            span.end = HostNs(commanded + round(order.seconds * NS_PER_S) + grace)
        return span

    @property
    def is_full(self) -> bool:
        """Whether the recording has as many pulses as ordered."""
        return self.wanted is not None and self.counted >= self.wanted

    def ends_before(self, pulse: ClosedPulse) -> bool:
        """Whether a pulse comes after the recording's last one. Pulses come in order: the first such pulse ends it."""
        self.over = self.over or self.is_full or (self.end is not None and pulse.time > self.end)
        return self.over

    def ended(self, decided: HostNs) -> bool:
        """Whether no further pulse belongs to it, provided that all pulses until `decided` were offered."""
        return self.over or self.is_full or (self.end is not None and decided > self.end)

    def stop(self, now: HostNs) -> None:
        """End with the last pulse that has fired until now, or before if that was planned."""
        self.end, self.stopped = now if self.end is None else min(self.end, now), True

    def count(self, pulse: ClosedPulse, by: int = 1) -> None:
        """Count a pulse that was handed to a log, or with -1 take it back."""
        self.counted += by * (pulse.time >= self.commanded)
