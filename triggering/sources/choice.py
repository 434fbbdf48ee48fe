"""The sources of pulses that a rig file can name, as a table of what distinguishes them.

Who commands the cameras, and when, differs:

- External pulses, and those of a computer's line or a trigger box, reach the cameras by cable, after delays that are
  not known: no trigger time is ruled out.
- Software triggers are commands that the grabber of each camera gives at even times of the host's clock. No program
  waits for another; the pulses of different cameras are the same because all count from the same origin.
- Action commands (GigE Vision) are sent by a process of its own (`action_sender`): one broadcast exposes all cameras of
  a network, either when it comes, or at a time of the cameras' PTP clocks, which the host does not choose.
- An asynchronous broadcast on FireWire comes to all nodes of a bus in the same cycle of 125 us (IIDC 1.31,
  Software_Trigger); a process of its own sends it, and the cameras' own clocks tell when they expose.

One conformance suite (`tests/triggering/sources/test_conformance.py`) runs over every source.
"""

from dataclasses import dataclass
from typing import Final

from rig.api.trigger import TriggerControl
from rig.clocks import HostNs
from rig.settings.trigger import (
    ActionTrigger,
    ExternalTrigger,
    GpioTrigger,
    IidcBroadcastTrigger,
    SoftwareTrigger,
    Trigger,
    TriggerBoxTrigger,
)
from triggering.sources.even_train import EvenTrain
from triggering.sources.triggerbox.protocol import nearest_rate


@dataclass(frozen=True, slots=True)
class TriggerSource:
    """A source of trigger pulses, for those who command cameras and pair frames.

    Attributes:
        advice: what to do if all cameras are ready, but its pulses give no complete triplet.
        controls: what svev can change of the pulses while the rig is armed; nothing: somebody else makes them.
        spread_ns: how far apart the source may expose the cameras at one pulse, ns; 0: one edge exposes all.
        set_up_only: its frames are good for setting up cameras, but not for measuring.
        by_grabbers: each grabber commands its camera, at even times.
        by_program: a process of its own sends commands to all cameras, at even times.
        period_ns: time between two commands.
        latest_ns: a command that would begin later than this after its pulse is not given.
    """

    advice: str
    controls: frozenset[TriggerControl] = frozenset(TriggerControl)
    spread_ns: int = 0
    set_up_only: bool = False
    by_grabbers: bool = False
    by_program: bool = False
    period_ns: int = 0
    latest_ns: int = 0

    def commands(self, origin: HostNs) -> EvenTrain | None:
        """The pulses at which a camera is to be told to expose by its grabber; None: its grabber tells it nothing.

        Args:
            origin: time of a pulse, the same for all cameras of the rig.
        """
        return self._train(origin) if self.by_grabbers else None

    def sent(self, origin: HostNs) -> EvenTrain | None:
        """The pulses that a program sends to all cameras at known times of the host's clock; None: there is none.

        Args:
            origin: as for `commands`.
        """
        return self._train(origin) if self.by_program else None

    def _train(self, origin: HostNs) -> EvenTrain:
        return EvenTrain(origin, self.period_ns, self.latest_ns, self.spread_ns)


_ADVICE: Final = {
    ExternalTrigger: "check the pulse generator, the trigger cables and trigger.rate_hz in the rig file",
    SoftwareTrigger: (
        "commands or frames come too late, or the cameras stamp their frames at the end of a long exposure; lower "
        "trigger.rate_hz or exposure_us in the rig file, and close other programs"
    ),
    ActionTrigger: (
        "see in the live log what the cameras answer to the action commands, and lower trigger.rate_hz in the rig file "
        "if they come too late"
    ),
    IidcBroadcastTrigger: (
        "see in the live log whether the commands are given; all cameras must be on one FireWire bus, and have a "
        "software trigger (IIDC 1.31)"
    ),
    TriggerBoxTrigger: "see what is said of the trigger box, and check the cable from it to the cameras",
    GpioTrigger: (
        "see in the live log whether the pulses are made, and check trigger.line in the rig file and the trigger cables"
    ),
}


def trigger_source(settings: Trigger) -> TriggerSource:
    """The source that `[trigger] source` names.

    Raises:
        BadInputError: it cannot make the pulses that are wanted.
    """
    advice = _ADVICE[type(settings)]
    match settings:
        case SoftwareTrigger():
            return TriggerSource(
                advice, frozenset({TriggerControl.RATE}), _spread_ns(settings), set_up_only=True, by_grabbers=True,
                period_ns=settings.period_ns, latest_ns=settings.latest_ns,
            )  # fmt: skip
        case ActionTrigger() if not settings.scheduled:
            # Commands that are sent one after the other are no single pulse.
            return TriggerSource(
                advice, spread_ns=_spread_ns(settings), set_up_only=not settings.broadcast, by_program=True,
                period_ns=settings.period_ns, latest_ns=settings.latest_ns,
            )  # fmt: skip
        case TriggerBoxTrigger():
            nearest_rate(settings.rate_hz)
        case ExternalTrigger():
            return TriggerSource(advice, frozenset())
    return TriggerSource(advice)


def _spread_ns(settings: SoftwareTrigger | ActionTrigger) -> int:
    """A command may begin late, and may be on its way for some time, ns."""
    return settings.latest_ns + settings.longest_ns
