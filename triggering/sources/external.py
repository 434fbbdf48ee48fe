"""Pulses from a generator that svev knows nothing of: cameras see them at their inputs."""

from rig.api.trigger import TriggerControl
from rig.clocks import HostNs


class ExternalPulses:
    """See `triggering.sources.seam.TriggerSource`."""

    spread_ns = 0
    set_up_only = False
    controls = frozenset[TriggerControl]()
    advice = "check the pulse generator, the trigger cables and trigger.rate_hz in the rig file"

    def commands(self, origin: HostNs) -> None:
        """No camera is told anything: `origin` has no meaning."""
        del origin

    def sent(self, origin: HostNs) -> None:
        """Nobody here sends the pulses: `origin` has no meaning."""
        del origin
