"""The program of the process that drives a trigger box: keeps its pulses going, and tells which have fired."""

from typing import Final

from rig.errors import BadInputError
from rig.events import TRIGGER, Event, Level
from rig.phrase import Phrase
from rig.settings.trigger import TriggerBoxTrigger
from rig.transport.child import begin
from rig.transport.recorder_commands import PulsesFired
from rig.transport.trigger_messages import LetPulses, TriggerBoxConfig, TriggerCommand, TriggerTold
from triggering.sources.gate import Gate
from triggering.sources.triggerbox.keeper import Fired, TrainKeeper
from triggering.sources.triggerbox.protocol import nearest_rate

#: Time to stop the pulses.
_GRACE_S: Final = 3.0


def main() -> None:
    """Make pulses until told to quit.

    Raises:
        BadInputError: the rig has no trigger box.
    """
    child = begin(TriggerBoxConfig, TriggerCommand, _GRACE_S)
    trigger = child.config.rig.trigger
    if not isinstance(trigger, TriggerBoxTrigger):
        raise BadInputError('the rig has no trigger box: set trigger.source = "triggerbox" in the rig file')

    def tell(level: Level, said: Phrase) -> None:
        child.control.send(TriggerTold(event=Event.now(level, TRIGGER, said)))

    def fired(pulses: Fired) -> None:
        child.control.send(
            PulsesFired(
                first=pulses.first, times=pulses.times, uncertainty_ns=pulses.uncertainty_ns, until=pulses.until
            )
        )

    def obey(command: TriggerCommand) -> None:
        if isinstance(command, LetPulses):
            gate.let(command.pulses)

    gate = Gate(still=child.config.still)
    child.on_command = obey
    keeper = TrainKeeper(
        child.config.port,
        nearest_rate(trigger.rate_hz),
        trigger.rate_hz,
        gate,
        tell=tell,
        fired=fired,
        wait=child.stops_within,
    )
    keeper.run()


if __name__ == "__main__":
    main()
