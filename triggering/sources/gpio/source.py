"""Pulses from a line of the computer, whose cable leads to all cameras. A process of its own makes them (`pulser`)."""

from rig.api.trigger import TriggerControl
from rig.clocks import HostNs


class GpioPulses:
    """See `triggering.sources.seam.TriggerSource`."""

    spread_ns = 0
    set_up_only = False
    controls = frozenset(TriggerControl)
    advice = (
        "see in the live log whether the pulses are made, and check trigger.line in the rig file and the trigger cables"
    )

    def commands(self, origin: HostNs) -> None:
        """No camera is told anything: `origin` has no meaning."""
        del origin

    def sent(self, origin: HostNs) -> None:
        """Cameras see the edge at their inputs, after cables and delays that are not known: no time is ruled out."""
        del origin
