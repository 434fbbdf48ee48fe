"""What a GigE Vision action command and the cameras that obey it have in common: the keys, and how it was answered."""

from dataclasses import dataclass
from typing import Annotated, Final

import msgspec
from msgspec import Meta

from rig.clocks import HostNs

_KEY_BITS: Final = 0xFFFFFFFF


@dataclass(frozen=True, slots=True)
class ActionKeys:
    """Keys of 32 bits: a camera obeys a command whose first two are its own, and whose mask has a bit of its own.

    Attributes:
        device: which cameras are meant.
        group: which of their actions is meant.
        mask: which part of this group is meant.
    """

    device: int
    group: int = 1
    mask: int = 1

    @classmethod
    def of(cls, origin: HostNs) -> "ActionKeys":
        """Keys that no other rig has and no earlier program had, so that their commands expose no camera of this one.

        Args:
            origin: time of a pulse, the same for all programs of the rig.
        """
        return cls(device=origin & _KEY_BITS | 1)


class ActionCounts(msgspec.Struct):
    """What a camera has answered to action commands while it was connected."""

    acknowledged: Annotated[int, Meta(description="commands that it took")] = 0
    late: Annotated[
        int, Meta(description="commands whose time was past when they came; most cameras expose at once")
    ] = 0
    refused: Annotated[int, Meta(description="commands that it did not take, e.g. without a reference time")] = 0
    unanswered: Annotated[
        int, Meta(description="commands that it did not answer in time, whether it took them or not")
    ] = 0
