"""Pulses that are commands to all FireWire cameras of a bus at once. A process of its own gives them.

An asynchronous broadcast comes to all nodes of a bus in the same cycle of 125 us (IIDC 1.31, Software_Trigger). Its
times are those of the line of a computer (`gpio.pulser`): even, or left out.
"""

from rig.api.trigger import TriggerControl
from rig.clocks import HostNs


class IidcBroadcastPulses:
    """See `triggering.sources.seam.TriggerSource`."""

    spread_ns = 0
    set_up_only = False
    controls = frozenset(TriggerControl)
    advice = (
        "see in the live log whether the commands are given; all cameras must be on one FireWire bus, and have a "
        "software trigger (IIDC 1.31)"
    )

    def commands(self, origin: HostNs) -> None:
        """No grabber tells its camera anything: `origin` has no meaning."""
        del origin

    def sent(self, origin: HostNs) -> None:
        """The cameras' own clocks tell when they expose: no time is ruled out."""
        del origin
