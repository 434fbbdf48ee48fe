"""An image message of a compacted log: the `foxglove.RawImage` that was recorded, its pixels coded without loss.

The fields before the pixels stand there as they were recorded; then come, in place of the pixels, the name of the
codec, the checksum that the recorder gave the chunk, and the coded pixels. So the recorded message is made again to the
last bit, and the recorder's own checksum says so.
"""

import struct
from dataclasses import dataclass
from typing import Any, Final

from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from google.protobuf.descriptor_pb2 import DescriptorProto, FieldDescriptorProto, FileDescriptorProto, FileDescriptorSet
from google.protobuf.message import DecodeError
from google.protobuf.timestamp_pb2 import DESCRIPTOR as TIMESTAMP
from mcap.records import Schema

from recorder.log.protobuf import fields, varint
from rig.images.pixels import Pixels

SCHEMA: Final = "svev.CodedImage"
_PACKAGE, _NAME = SCHEMA.split(".")
_CODEC, _RECORDED_CRC, _CODED = 16, 17, 18
_CODEC_KEY, _CRC_KEY, _CODED_KEY = _CODEC << 3 | 2, _RECORDED_CRC << 3 | 5, _CODED << 3 | 2
_CRC: Final = struct.Struct("<I")
#: The fields before the pixels take some 50 bytes.
_HEAD_MAX: Final = 1 << 12


@dataclass(frozen=True, slots=True)
class CodedImage:
    """A message of a compacted log.

    Attributes:
        head: the serialized `foxglove.RawImage` as it was recorded, up to the field of its pixels.
        codec: how the pixels are coded.
        recorded_crc: CRC-32 of the records of the chunk, tag and images, as they were recorded.
        coded: the pixels.
    """

    head: bytes
    codec: str
    recorded_crc: int
    coded: memoryview | bytes

    @classmethod
    def of(cls, message: memoryview) -> "CodedImage | None":
        """Read a message; None: it is no coded image, perhaps no message at all.

        Raises:
            ValueError: it is a damaged one.
        """
        try:
            found = {field.key: field for field in fields(message) if field.key >= _CODEC << 3}
        except ValueError:
            return None
        if not found:
            return None
        if list(found) != [_CODEC_KEY, _CRC_KEY, _CODED_KEY] or found[_CODED_KEY].end != len(message):
            raise ValueError("it is no coded image of this version")
        codec, crc, coded = found.values()
        if codec.begin > _HEAD_MAX or codec.end - codec.content > _HEAD_MAX:
            raise ValueError("what stands before its pixels is too long")
        return cls(
            bytes(message[: codec.begin]),
            bytes(message[codec.content : codec.end]).decode(),
            _CRC.unpack(message[crc.content : crc.end])[0],
            message[coded.content : coded.end],
        )

    def encode(self) -> bytes:
        """The message."""
        codec = self.codec.encode()
        return b"".join(
            (
                self.head,
                varint(_CODEC_KEY), varint(len(codec)), codec,
                varint(_CRC_KEY), _CRC.pack(self.recorded_crc),
                varint(_CODED_KEY), varint(len(self.coded)), self.coded,
            )
        )  # fmt: skip

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        image = self._image()
        return image.height, image.width

    @property
    def kind(self) -> Pixels:
        """How the pixels are held when they are decoded; of 16 bits all count as significant.

        Raises:
            ValueError: as no log of ours does.
        """
        encoding = self._image().encoding
        return Pixels(encoding, 16 if encoding == "mono16" else 8)

    def _image(self) -> Any:
        try:
            return RawImage.FromString(self.head)
        except DecodeError as error:
            raise ValueError(f"what stands before its pixels is no foxglove.RawImage: {error}") from None


def coded_schema(number: int) -> Schema:
    """The schema of these messages: that of `foxglove.RawImage` with other fields in place of the pixels."""
    message = DescriptorProto()
    RawImage.DESCRIPTOR.CopyToProto(message)
    message.name = _NAME
    kept = [field for field in message.field if field.number != RawImage.DATA_FIELD_NUMBER]
    del message.field[:]
    message.field.extend(kept)
    kinds = FieldDescriptorProto
    for name, field, kind in (
        ("codec", _CODEC, kinds.TYPE_STRING),
        ("recorded_crc", _RECORDED_CRC, kinds.TYPE_FIXED32),
        ("coded", _CODED, kinds.TYPE_BYTES),
    ):
        message.field.add(name=name, number=field, type=kind, label=kinds.LABEL_OPTIONAL)
    file = FileDescriptorProto(
        name=f"{_PACKAGE}/{_NAME}.proto", package=_PACKAGE, syntax="proto3", dependency=[TIMESTAMP.name]
    )
    file.message_type.append(message)
    timestamp = FileDescriptorProto()
    TIMESTAMP.CopyToProto(timestamp)
    return Schema(number, FileDescriptorSet(file=[timestamp, file]).SerializeToString(), "protobuf", SCHEMA)
