"""A trigger box as a source of pulses: its cable leads to all cameras, and a process of its own drives it."""

from rig.api.trigger import TriggerControl
from rig.clocks import HostNs
from rig.settings.trigger import TriggerBoxTrigger
from triggering.sources.triggerbox.protocol import Rate, nearest_rate


class TriggerBoxPulses:
    """See `triggering.sources.seam.TriggerSource`.

    Args:
        settings: of the rig file.

    Attributes:
        rate: that the box makes.

    Raises:
        BadInputError: the box cannot make the rate.
    """

    spread_ns = 0
    set_up_only = False
    controls = frozenset(TriggerControl)
    advice = "see what is said of the trigger box, and check the cable from it to the cameras"

    def __init__(self, settings: TriggerBoxTrigger) -> None:
        self.rate: Rate = nearest_rate(settings.rate_hz)

    def commands(self, origin: HostNs) -> None:
        """No camera is told anything: `origin` has no meaning."""
        del origin

    def sent(self, origin: HostNs) -> None:
        """The box fires when it will, not at times that the host chooses: `origin` has no meaning."""
        del origin
