"""Puts the images that were recorded in the place of those that a compacted log holds."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from isal.isal_zlib import crc32

from recorder.log.coded_image import CodedImage
from recorder.log.mcap_layout import CHUNK_MAX, message_head, pixels_field
from recorder.reading.items import Message
from rig.topics import CAMERA_TOPIC, TRIPLET


def is_image(message: Message) -> bool:
    """Whether a message holds an image, of a triplet or of one camera."""
    return message.topic == TRIPLET.name or message.topic.startswith(CAMERA_TOPIC)


def with_images(messages: Sequence[Message]) -> tuple[list[Message], str]:
    """The messages of a chunk as they were recorded.

    Args:
        messages: as they stand in the log, with their data.

    Returns:
        The messages, and what is wrong with them; empty: the checksum that the recorder gave the chunk is theirs, or
        no image of them is coded.
    """
    restored, crcs, room = list(messages), set(), CHUNK_MAX
    for place, message in enumerate(messages):
        if not is_image(message) or message.data is None:
            continue
        try:
            coded = CodedImage.of(message.data)
            if coded is None:
                continue
            rows, columns = coded.shape
            room -= rows * columns * coded.kind.size
            if room < 0 or not rows or not columns:
                raise ValueError("it has no size, or too large a one")  # noqa: TRY301 - said below
            restored[place] = replace(message, data=memoryview(_recorded(coded)))
        except ValueError as error:
            return restored, f"the image of pulse {message.sequence} cannot be decoded: {error}"
        crcs.add(coded.recorded_crc)
    if crcs and crcs != {records_crc(restored)}:
        return restored, "its images are not those that were recorded: the checksum of the recorder is not theirs"
    return restored, ""


def records_crc(messages: Iterable[Message]) -> int:
    """CRC-32 of the records of messages, with their data, as a chunk of them has it."""
    crc = 0
    for message in messages:
        data = message.data or memoryview(b"")
        head = message_head(message.channel, message.sequence, len(data), message.publish_time, message.log_time)
        crc = crc32(data, crc32(head, crc))
    return crc


def _recorded(coded: CodedImage) -> bytearray:
    from recorder.log.ffv1 import CODEC, decoded  # noqa: PLC0415 - who reads no compacted log needs no decoder

    if coded.codec != CODEC:
        raise ValueError("this version does not know its codec")
    pixels = decoded(bytes(coded.coded), coded.shape, coded.kind.size)
    before = coded.head + pixels_field(coded.shape, coded.kind)
    message = bytearray(len(before) + pixels.nbytes)  # a large image is there twice, not more often
    message[: len(before)] = before
    np.frombuffer(message, pixels.dtype, offset=len(before)).reshape(pixels.shape)[:] = pixels
    return message
