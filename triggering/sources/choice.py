"""Makes the source of pulses that a rig file names."""

from rig.settings.trigger import SoftwareTrigger, Trigger
from triggering.sources.external import ExternalPulses
from triggering.sources.seam import TriggerSource
from triggering.sources.software import SoftwarePulses


def trigger_source(settings: Trigger) -> TriggerSource:
    """The source that `[trigger] source` names."""
    return SoftwarePulses(settings) if isinstance(settings, SoftwareTrigger) else ExternalPulses()
