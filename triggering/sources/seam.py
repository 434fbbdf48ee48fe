"""What every source of pulses tells those who command cameras and those who pair frames: the `TriggerSource` protocol.

One conformance suite (`tests/triggering/sources/test_conformance.py`) runs over every source.
"""

from typing import Protocol

from rig.api.trigger import TriggerControl
from rig.clocks import HostNs


class CommandTrain(Protocol):
    """The pulses of a source that tells cameras to expose. It serves one sender, and waits for nothing itself."""

    def until_next_ns(self, now: HostNs) -> int:
        """Time from `now` to the next pulse, ns; 0 or more."""
        ...

    def is_due(self, now: HostNs) -> bool:
        """Whether the camera is to be told now to expose.

        It is so once for each pulse, and not for one that is past by more than the source allows: a pulse without a
        frame is better than a frame that belongs to none.
        """
        ...

    def begin(self) -> None:
        """Note that the camera has just become ready, or all are: no pulse before is due any more."""
        ...

    def withheld(self) -> int:
        """How many pulses since the last call had no command, because it would have come too late."""
        ...

    def exposes(self, time: HostNs, within_ns: float) -> bool:
        """Whether a camera that was told in time can have exposed at `time`.

        Args:
            time: trigger time of a frame.
            within_ns: limit of its error.
        """
        ...


class TriggerSource(Protocol):
    """A source of trigger pulses."""

    @property
    def spread_ns(self) -> int:
        """How far apart the source may expose the cameras at one pulse, ns; 0: one edge exposes all."""
        ...

    @property
    def set_up_only(self) -> bool:
        """Whether its frames are good for setting up cameras, but not for measuring."""
        ...

    @property
    def controls(self) -> frozenset[TriggerControl]:
        """What svev can change of the pulses while the rig is armed; nothing: somebody else makes them."""
        ...

    @property
    def advice(self) -> str:
        """What to do if all cameras are ready, but its pulses give no complete triplet."""
        ...

    def commands(self, origin: HostNs) -> CommandTrain | None:
        """The pulses at which a camera is to be told to expose by its grabber; None: it sees them by itself.

        Args:
            origin: time of a pulse, the same for all cameras of the rig.
        """
        ...

    def sent(self, origin: HostNs) -> CommandTrain | None:
        """The pulses that a process of its own sends to the cameras at known times of the host's clock; None: no such.

        Args:
            origin: as for `commands`.
        """
        ...
