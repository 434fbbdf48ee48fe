"""Writes logs of any content, record by record: sound where nothing else is said, so that what is odd is reached."""

import json
import os
import struct
from pathlib import Path
from typing import Any, Self

from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from isal.isal_zlib import crc32
from mcap.opcode import Opcode
from mcap.records import Channel, DataEnd, Footer, Header, Metadata

from recorder.log.channels import schemas_and_channels
from recorder.log.mcap_layout import EVENTS_CHANNEL, HEALTH_CHANNEL, MAGIC, TAG_CHANNEL, TRIPLET_CHANNEL, records
from rig.transport import wire
from tests.recorder.logs import RIG, SESSION, SHAPE, START, make_image, make_tag


def record(opcode: int, body: bytes, length: int | None = None) -> bytes:
    """A record; `length`: what it says of itself, if not the truth."""
    return struct.pack("<BQ", opcode, len(body) if length is None else length) + body


def message(channel: int, sequence: int, data: bytes, time: int = START) -> bytes:
    """A message record."""
    head = struct.pack("<HIQQ", channel, sequence % (1 << 32), time % (1 << 64), time % (1 << 64))
    return record(Opcode.MESSAGE, head + data)


def chunk(content: bytes, *, size: int | None = None, compression: str = "") -> bytes:
    """A chunk with a right checksum; `size`: what it says of its content."""
    said = len(content) if size is None else size
    name = compression.encode()
    head = struct.pack("<QQQII", START, START, said, crc32(content), len(name)) + name + struct.pack("<Q", said)
    return record(Opcode.CHUNK, head + content, len(head) + said)


def text(words: str) -> bytes:
    """A string in a record."""
    return struct.pack("<I", len(words.encode())) + words.encode()


def image(pulse: int, **fields: Any) -> bytes:
    """A serialized image of a pulse, some of its fields changed."""
    tag = make_tag(pulse)
    found = RawImage(frame_id="triplet", height=SHAPE[0], width=SHAPE[1], step=SHAPE[1], encoding="mono8")
    found.timestamp.FromNanoseconds(tag.time)
    found.data = make_image(tag).tobytes()
    for name, value in fields.items():
        setattr(found, name, value)
    data: bytes = found.SerializeToString()
    return data


def event(**fields: Any) -> bytes:
    """A serialized event, some of its fields changed."""
    found = Log(name="recorder", message="something", level=Log.Level.Value("INFO"))
    found.timestamp.FromNanoseconds(START)
    for name, value in fields.items():
        setattr(found, name, value)
    data: bytes = found.SerializeToString()
    return data


class Builder:
    """A log in the making; what is added stands behind header, schemas, channels and metadata."""

    def __init__(self, *, header: bytes | None = None, declared: bool = True) -> None:
        self._parts: list[bytes | int] = [MAGIC, records(Header("svev", "hostile")) if header is None else header]
        if declared:
            schemas, channels = schemas_and_channels()
            self.add(records(*schemas, *channels))
            self.add(records(Metadata("svev.session", SESSION), Metadata("svev.rig", RIG)))

    def add(self, *parts: bytes) -> Self:
        """Add bytes."""
        self._parts += parts
        return self

    def hole(self, size: int) -> Self:
        """Add zeros that take no room on the disk."""
        self._parts.append(size)
        return self

    def pulse(self, number: int, tag: bytes | None = None, picture: bytes | None = None) -> Self:
        """Add a pulse; `tag` and `picture` replace what a recorder would write."""
        sound = make_tag(number)
        tags = message(TAG_CHANNEL, number, sound.encode() if tag is None else tag, sound.time)
        pictures = message(TRIPLET_CHANNEL, number, image(number) if picture is None else picture, sound.time)
        return self.add(chunk(tags + pictures))

    def odd_tag(self, tag: bytes) -> Self:
        """Add three pulses, of which the second has this tag."""
        return self.pulse(1).pulse(2, tag).pulse(3)

    def tag_with(self, **fields: Any) -> Self:
        """Add three pulses; in the tag of the second these fields are replaced; texts that begin with = are JSON."""
        return self.odd_tag(_json(wire.to_builtins(make_tag(2)) | fields))

    def camera_with(self, **fields: Any) -> Self:
        """As `tag_with`, for the first camera in the tag."""
        tag = wire.to_builtins(make_tag(2))
        tag["cameras"][0] |= fields
        return self.odd_tag(_json(tag))

    def picture(self, picture: bytes) -> Self:
        """Add three pulses, of which the second has this image."""
        return self.pulse(1).pulse(2, None, picture).pulse(3)

    def event(self, data: bytes) -> Self:
        """Add an event between two pulses."""
        return self.pulse(1).add(chunk(message(EVENTS_CHANNEL, 1, data))).pulse(2)

    def health(self, data: bytes) -> Self:
        """Add a health record between two pulses."""
        return self.pulse(1).add(chunk(message(HEALTH_CHANNEL, 1, data))).pulse(2)

    def metadata(self, name: str, **fields: str) -> Self:
        """Add a pulse and a metadata record."""
        return self.pulse(1).add(records(Metadata(name, fields)))

    def channel(self, number: int, topic: str) -> Self:
        """Add a channel."""
        return self.add(records(Channel(number, topic, "json", {}, 0)))

    def close(self) -> Self:
        """Add what ends a closed log, without a summary."""
        return self.add(records(DataEnd(0), Footer(0, 0, 0)), MAGIC)

    def write(self, path: Path) -> None:
        """Write the log, holes as holes."""
        with path.open("wb") as file:
            for part in self._parts:
                if isinstance(part, int):
                    file.seek(part, os.SEEK_CUR)
                else:
                    file.write(part)
            file.truncate()


def _json(tag: dict[str, Any]) -> bytes:
    """JSON of a tag in which texts that begin with = stand as they are."""
    spliced = json.dumps(tag)
    for value in (*tag.values(), *(value for camera in tag["cameras"] for value in camera.values())):
        if isinstance(value, str) and value.startswith("="):
            spliced = spliced.replace(json.dumps(value), value[1:])
    return spliced.encode()
