"""Pulses that are GigE Vision action commands: at once when they come, or at a time of the cameras' PTP clocks.

A process of its own sends them (`action_sender`): one command by broadcast exposes all cameras of a network, and no
program that controls a camera is waited for. Scheduled commands are for whole multiples of the period in PTP time.
"""

from rig.api.trigger import TriggerControl
from rig.clocks import HostNs
from rig.settings.trigger import ActionTrigger
from triggering.sources.even_train import EvenTrain


class ActionPulses:
    """See `triggering.sources.seam.TriggerSource`.

    Args:
        settings: of the rig file.
    """

    controls = frozenset(TriggerControl)
    advice = (
        "see in the live log what the cameras answer to the action commands, and lower trigger.rate_hz in the rig file "
        "if they come too late"
    )

    def __init__(self, settings: ActionTrigger) -> None:
        self._settings = settings

    @property
    def spread_ns(self) -> int:
        """A command may be sent late, and may be on its way for some time; PTP makes that of no account."""
        return 0 if self._settings.scheduled else self._settings.latest_ns + self._settings.longest_ns

    @property
    def set_up_only(self) -> bool:
        """Commands that are sent one after the other, and obeyed as they come, are no single pulse."""
        return not self._settings.scheduled and not self._settings.broadcast

    def commands(self, origin: HostNs) -> None:
        """No grabber tells its camera anything: `origin` has no meaning."""
        del origin

    def sent(self, origin: HostNs) -> EvenTrain | None:
        """See `triggering.sources.seam.TriggerSource.sent`; the host does not choose the time of scheduled pulses."""
        if self._settings.scheduled:
            return None
        return EvenTrain(origin, self._settings.period_ns, self._settings.latest_ns, self.spread_ns)
