"""Makes the source of pulses that a rig file names."""

from rig.settings.trigger import (
    ActionTrigger,
    GpioTrigger,
    IidcBroadcastTrigger,
    SoftwareTrigger,
    Trigger,
    TriggerBoxTrigger,
)
from triggering.sources.action import ActionPulses
from triggering.sources.external import ExternalPulses
from triggering.sources.gpio.source import GpioPulses
from triggering.sources.iidc_broadcast import IidcBroadcastPulses
from triggering.sources.seam import TriggerSource
from triggering.sources.software import SoftwarePulses
from triggering.sources.triggerbox.source import TriggerBoxPulses


def trigger_source(settings: Trigger) -> TriggerSource:
    """The source that `[trigger] source` names.

    Raises:
        BadInputError: it cannot make the pulses that are wanted.
    """
    match settings:
        case SoftwareTrigger():
            return SoftwarePulses(settings)
        case ActionTrigger():
            return ActionPulses(settings)
        case IidcBroadcastTrigger():
            return IidcBroadcastPulses()
        case TriggerBoxTrigger():
            return TriggerBoxPulses(settings)
        case GpioTrigger():
            return GpioPulses()
        case _:
            return ExternalPulses()
