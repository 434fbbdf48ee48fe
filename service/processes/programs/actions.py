"""The program of the process that sends the pulses, where they are GigE Vision action commands."""

import select
from typing import Final

from rig.clocks import NS_PER_S, HostNs, host_now
from rig.events import TRIGGER, Event, Level
from rig.phrase import Phrase
from rig.settings.trigger import ActionTrigger
from rig.transport.channel import ControlChannel
from rig.transport.child import begin
from rig.transport.message import Quit
from rig.transport.recorder_commands import TellActions
from rig.transport.trigger_messages import CamerasSeen, LetPulses, TriggerCommand, TriggerConfig, TriggerTold
from service.processes.priority import allowed_priority, prefer_this_process
from triggering.sources.action_sender import ActionSender
from triggering.sources.gate import Gate

#: Nothing is lost when it ends.
_GRACE_S: Final = 2.0
_TURN_MS: Final = 50
_REPORT_EVERY_NS: Final = NS_PER_S // 2


def main() -> None:
    """Send pulses until told to quit."""
    child = begin(TriggerConfig, TriggerCommand, _GRACE_S)
    rig = child.config.rig
    if not isinstance(rig.trigger, ActionTrigger):
        raise SystemExit(f'trigger: source "{rig.trigger.source}" needs no process that sends pulses')
    prefer_this_process(allowed_priority())
    cameras = [(camera.address, camera.name) for camera in rig.cameras]
    gate = Gate(still=child.config.still)
    sender = ActionSender(rig.trigger, child.config.epoch, cameras, gate)
    sender.start()
    try:
        _attend(child.control, sender, gate)
    finally:
        sender.stop()


def _attend(control: ControlChannel[TriggerCommand], sender: ActionSender, gate: Gate) -> None:
    """Read answers and orders, and report, until told to quit or until the service is gone."""
    next_report = HostNs(0)
    poll = select.poll()
    poll.register(sender, select.POLLIN)
    poll.register(control, select.POLLIN)
    quitting = False
    while not (quitting or control.ended):
        poll.poll(_TURN_MS)
        for command in control.receive(0):
            match command:
                case CamerasSeen():
                    _tell(control, sender.seen(command.connected, command.offsets_ns))
                case LetPulses():
                    gate.let(command.pulses)
                case Quit():
                    quitting = True
        _tell(control, sender.read())
        if (now := host_now()) >= next_report:
            next_report = HostNs(now + _REPORT_EVERY_NS)
            control.send(TellActions(counts=sender.counts))


def _tell(control: ControlChannel[TriggerCommand], said: list[Phrase]) -> None:
    for each in said:
        control.send(TriggerTold(event=Event.now(Level.WARNING, TRIGGER, each)))


if __name__ == "__main__":
    main()
