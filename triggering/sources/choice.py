"""Makes the source of pulses that a rig file names."""

from rig.settings.trigger import ActionTrigger, SoftwareTrigger, Trigger
from triggering.sources.action import ActionPulses
from triggering.sources.external import ExternalPulses
from triggering.sources.seam import TriggerSource
from triggering.sources.software import SoftwarePulses


def trigger_source(settings: Trigger) -> TriggerSource:
    """The source that `[trigger] source` names."""
    match settings:
        case SoftwareTrigger():
            return SoftwarePulses(settings)
        case ActionTrigger():
            return ActionPulses(settings)
        case _:
            return ExternalPulses()
