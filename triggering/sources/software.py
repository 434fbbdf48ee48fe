"""Pulses that are commands to each camera, at even times of the host's clock, which all programs of a computer share.

The grabber of each camera gives its commands by itself, so no program waits for another; the pulses of different
cameras are the same because all count from the same origin.
"""

from rig.api.trigger import TriggerControl
from rig.clocks import HostNs
from rig.settings.trigger import SoftwareTrigger
from triggering.sources.even_train import EvenTrain


class SoftwarePulses:
    """See `triggering.sources.seam.TriggerSource`.

    Args:
        settings: of the rig file.
    """

    set_up_only = True
    controls = frozenset({TriggerControl.RATE})
    advice = (
        "commands or frames come too late, or the cameras stamp their frames at the end of a long exposure; lower "
        "trigger.rate_hz or exposure_us in the rig file, and close other programs"
    )

    def __init__(self, settings: SoftwareTrigger) -> None:
        self._settings = settings

    @property
    def spread_ns(self) -> int:
        """A command may begin late, and may be on its way for some time."""
        return self._settings.latest_ns + self._settings.longest_ns

    def commands(self, origin: HostNs) -> EvenTrain:
        """See `triggering.sources.seam.TriggerSource.commands`."""
        return EvenTrain(origin, self._settings.period_ns, self._settings.latest_ns, self.spread_ns)

    def sent(self, origin: HostNs) -> None:
        """No command is for all cameras: `origin` has no meaning."""
        del origin
