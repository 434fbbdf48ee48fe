"""Finds the tags of pulses in bytes of a log that are no longer sound.

A tag is small beside its image, so what damages a chunk seldom damages its tag. One is taken for true only if the head
of its message says the same pulse and time: then neither was hit.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Final

from mcap.opcode import Opcode

from recorder.log_items import Message
from recorder.log_reader import LogReader
from recorder.mcap_layout import MESSAGE, RECORD, TAG_CHANNEL
from rig.frame import FrameStatus
from rig.tag import CameraTag, TripletTag

_PIECE: Final = 4 << 20
_TAG_MAX: Final = 1 << 16
_MARK: Final = b'{"pulse":'


def salvaged_tags(reader: LogReader, offset: int, length: int) -> Iterator[TripletTag]:
    """The tags that stand whole somewhere in these bytes of a log."""
    overlap = MESSAGE.size + _TAG_MAX
    for begin in range(offset, offset + length, _PIECE):
        piece = bytes(reader.read(begin, min(_PIECE + overlap, offset + length - begin)))
        place = piece.find(_MARK)
        while 0 <= place < _PIECE + MESSAGE.size:
            if place >= MESSAGE.size and (tag := _tag_at(piece, place)) is not None:
                yield tag
            place = piece.find(_MARK, place + 1)


def tag_from_heads(messages: Sequence[Message], like: TripletTag) -> TripletTag | None:
    """The tag of a pulse whose tag is destroyed, while the heads of its two messages agree on number and time.

    Args:
        messages: those of a chunk, as far as they could be read.
        like: an earlier tag of the recording, for its cameras.

    Returns:
        A tag that says of all cameras that their frames are damaged; None if the heads do not agree.
    """
    for one, other in pairwise(messages):
        if (one.sequence, one.publish_time) == (other.sequence, other.publish_time) and one.channel == TAG_CHANNEL:
            return without_pixels(replace(like, pulse=one.sequence, time=one.publish_time), everything=True)
    return None


def without_pixels(tag: TripletTag, *, everything: bool = False) -> TripletTag:
    """The tag of a pulse whose pixels are lost: frames that came whole are damaged now; all of them if `everything`."""
    cameras = tuple(
        CameraTag(camera.name, camera.columns, FrameStatus.DAMAGED)
        if everything or camera.status is FrameStatus.OK
        else camera
        for camera in tag.cameras
    )
    return replace(tag, cameras=cameras)


def _tag_at(piece: bytes, place: int) -> TripletTag | None:
    """The tag at `place`, None if it is not whole or the head before it says something else."""
    opcode, length, channel, sequence, _, publish_time = MESSAGE.unpack_from(piece, place - MESSAGE.size)
    end = place - MESSAGE.size + RECORD.size + length
    if opcode != Opcode.MESSAGE or channel != TAG_CHANNEL or not place < end <= min(len(piece), place + _TAG_MAX):
        return None
    try:
        tag = TripletTag.decode(piece[place:end])
    except (ValueError, KeyError, TypeError):
        return None
    return tag if (tag.pulse, tag.time) == (sequence, publish_time) else None
