"""What all messages between the processes of a rig have in common.

The first message to a child is its configuration; then the parent sends commands and the child sends reports. The
channel (`rig.transport.channel`) encodes and checks messages by their types, one for each.
"""

from typing import ClassVar

import msgspec


class Message(msgspec.Struct, kw_only=True, tag=True):
    """Base of all messages.

    Attributes:
        is_state: whether a message tells a state, so that only the latest of its type matters to a late reader.
    """

    is_state: ClassVar[bool] = False


class Quit(Message):
    """Command to any child: finish the work in progress, then end."""
