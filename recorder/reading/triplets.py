"""Reads the triplets of a log: tag and image of every pulse in order, or single ones; copies no pixels."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec
import numpy as np
from foxglove_schemas_protobuf.RawImage_pb2 import RawImage
from google.protobuf.message import DecodeError

from recorder.log.mcap_layout import CHUNK_MAX, raw_image_prefix
from recorder.log.protobuf import fields
from recorder.reading.items import Chunk, Message
from recorder.reading.log_reader import LogReader
from recorder.reading.parts import RecordingReader
from rig.clocks import UtcNs
from rig.events import Event
from rig.health import Health
from rig.images.pixels import Pixels, Stored
from rig.tag import TripletTag
from rig.topics import CAMERA_TOPIC, TAG, TRIPLET
from rig.transport import wire

#: Pulse numbers are 32 bits in MCAP; times are below 2**63 ns (year 2262).
_SEQUENCE_MAX, _TIME_MAX = (1 << 32) - 1, (1 << 63) - 1
#: All fields of an image but its pixels take some 50 bytes.
_OTHERS_MAX = 1 << 12
_HEALTH = wire.decoder(Health)
_DATA_KEY = RawImage.DATA_FIELD_NUMBER << 3 | 2


def triplets(path: Path) -> Iterator[tuple[TripletTag, Stored]]:
    """Every pulse of a recording: its tag, and its image, (rows, columns), valid until the next one is taken.

    The block of a camera that is not ok is black; the whole image of a pulse without any frame is black. Pulses in
    damaged parts of the log are left out.

    Raises:
        BadInputError: no such file, no MCAP log, or not one of ours.
        ValueError: a chunk is sound, but what it holds is no tag or no image.
    """
    with RecordingReader(path) as reader:
        for chunk in reader.sound_chunks():
            images = {pulse: image.data for pulse, image in images_of(chunk).items()}
            for message in chunk.messages:
                if message.topic == TAG.name and message.data is not None:
                    tag = read_tag(message.data)
                    data = images.get(tag.pulse)
                    yield tag, np.zeros(tag.shape, tag.pixels.dtype) if data is None else pixels(view_image(data))


def tags(path: Path, *, links: bool = True) -> Iterator[TripletTag]:
    """The tags of a recording, in its order, without those in damaged parts; reads no pixels.

    Args:
        path: the log, or any part of a split one.
        links: whether a link of this name is followed.

    Raises:
        BadInputError: the log cannot be read.
    """
    with RecordingReader(path, skim=True, links=links) as reader:
        for chunk in reader.sound_chunks(only=(TAG.name,)):
            for message in chunk.messages:
                if (tag := tag_of(message)) is not None:
                    yield tag


@dataclass(frozen=True, slots=True)
class StoredTriplet:
    """Where the chunk of a pulse stands in the file: `length` bytes from `offset` on."""

    tag: TripletTag
    offset: int
    length: int

    def image(self, reader: LogReader) -> Stored:
        """The pixels, (rows, columns), valid until anything else is read.

        Raises:
            ValueError: the chunk is damaged, or holds no image of ours.
        """
        return stored_image(reader, self.tag.pulse, self.offset, self.length)[0]


def stored_image(reader: LogReader, pulse: int, offset: int, length: int) -> tuple[Stored, Pixels]:
    """The image of a pulse, (rows, columns), and how it holds its pixels; valid until anything else is read.

    Raises:
        ValueError: the chunk is damaged, or holds no image of ours.
    """
    chunk = reader.chunk(offset, length)
    image = images_of(chunk).get(pulse)
    if chunk.flaw or image is None or image.data is None:
        raise ValueError(chunk.flaw or "its chunk holds no whole image")
    view = view_image(image.data)
    found = (tag_of(message) for message in chunk.messages if message.sequence == pulse)
    return pixels(view), next((tag.pixels for tag in found if tag is not None), view.kind)


def images_of(chunk: Chunk) -> dict[int, Message]:
    """The images of triplets in a chunk, by pulse: as they stand there, or put together from those of the cameras.

    The images of a pulse's cameras make a triplet only if all are of the same time and height.
    """
    images = {message.sequence: message for message in chunk.messages if message.topic == TRIPLET.name}
    for pulse, messages in camera_images_of(chunk).items():
        if (triplet := _side_by_side(messages)) is not None:
            images.setdefault(pulse, triplet)
    return images


def camera_images_of(chunk: Chunk) -> dict[int, list[Message]]:
    """The images of single cameras in a chunk, left to right, by pulse; none in a log with images of triplets."""
    cameras: dict[int, list[Message]] = defaultdict(list)
    for message in sorted(chunk.messages, key=lambda message: message.channel):
        if message.topic.startswith(CAMERA_TOPIC):
            cameras[message.sequence].append(message)
    return cameras


def _side_by_side(messages: Sequence[Message]) -> Message | None:
    """The image message of a triplet, made from those of its cameras; None if they do not fit together."""
    first = messages[0]
    if first.data is None:
        return replace(first, topic=TRIPLET.name)  # nobody has asked for pixels
    try:
        views = [view_image(message.data or memoryview(b"")) for message in messages]
        blocks = [pixels(view) for view in views]
    except ValueError:
        return None
    if len({(view.time, view.rows, view.encoding) for view in views}) > 1:
        return None
    whole = np.hstack(blocks)
    data = raw_image_prefix((whole.shape[0], whole.shape[1]), views[0].time, views[0].kind) + whole.tobytes()
    return replace(first, topic=TRIPLET.name, data=memoryview(data))


def stored_pulses(reader: LogReader) -> Iterator[tuple[TripletTag, StoredTriplet | None]]:
    """All pulses of a log, each with where its image stands; None: it has none. Reads no pixels."""
    for chunk in reader.sound_chunks(only=(TAG.name,)):
        images = images_of(chunk)
        for pulse, tag in {m.sequence: tag for m in chunk.messages if (tag := tag_of(m)) is not None}.items():
            yield tag, StoredTriplet(tag, chunk.offset, chunk.length) if pulse in images else None


def stored_triplets(reader: LogReader) -> list[StoredTriplet]:
    """All pulses of a log that have an image; reads no pixels."""
    return [stored for _, stored in stored_pulses(reader) if stored is not None]


def tag_of(message: Message) -> TripletTag | None:
    """The tag in a message; None for other messages, and for a damaged tag (which `verify` reports)."""
    return None if message.topic != TAG.name or message.data is None else decoded_tag(message.data)


def decoded_tag(data: bytes | memoryview) -> TripletTag | None:
    """The tag that these bytes encode, None if they encode none."""
    try:
        return read_tag(data)
    except ValueError:
        return None


def event_of(message: Message) -> Event | None:
    """The event in a message, None if it holds none."""
    try:
        return Event.from_protobuf(message.data or b"")
    except (DecodeError, ValueError, KeyError):
        return None


def health_of(message: Message) -> Health | None:
    """The health record in a message; None if it is damaged, or of another version of svev."""
    try:
        health: Health = _HEALTH.decode(message.data or b"")
    except (msgspec.MsgspecError, RecursionError):
        return None
    return health


def is_json(data: bytes | memoryview) -> bool:
    """Whether these bytes are JSON, nested no deeper than any reader takes."""
    try:
        msgspec.json.decode(data)
    except (msgspec.MsgspecError, RecursionError):
        return False
    return True


def read_tag(data: bytes | memoryview) -> TripletTag:
    """The tag that these bytes encode.

    Raises:
        ValueError: they encode none, or one with numbers that no recorder writes.
    """
    tag = TripletTag.decode(data)
    rows, columns = tag.shape
    if not (tag.pulse <= _SEQUENCE_MAX and 0 <= tag.time <= _TIME_MAX):
        raise ValueError("pulse or time out of bounds")
    if rows < 1 or columns < 1 or rows * columns * tag.pixels.size > CHUNK_MAX or not tag.cameras:
        raise ValueError("no shape of a triplet")
    return tag


@dataclass(frozen=True, slots=True)
class ImageView:
    """A serialized `foxglove.RawImage`.

    Attributes:
        time: time stamp, UTC.
        rows, columns: size in px.
        step: bytes from row to row.
        encoding: of the pixels; ours are "mono8", "mono16" and those of Bayer mosaics with 8 bits.
        pixels: the pixels in place, no copy; as many bytes as the message says, or as it has left.
    """

    time: UtcNs
    rows: int
    columns: int
    step: int
    encoding: str
    pixels: memoryview

    @property
    def kind(self) -> Pixels:
        """How the pixels are held; an image does not say how many of 16 bits are significant: its tag does.

        Raises:
            ValueError: as no log of ours does.
        """
        try:
            return Pixels(self.encoding, 16 if self.encoding == "mono16" else 8)
        except ValueError:
            raise ValueError(f'the image is "{self.encoding}", which no recorder of svev writes') from None


def view_image(message: memoryview) -> ImageView:
    """Read an image message without copying its pixels.

    Raises:
        ValueError: the bytes are no `foxglove.RawImage`.
    """
    others, pixels = bytearray(), memoryview(b"")
    for field in fields(message):
        if len(others) > _OTHERS_MAX:
            raise ValueError("no foxglove.RawImage: too many fields")
        if field.key == _DATA_KEY:
            pixels = message[field.content : field.end]
        else:
            others += message[field.begin : field.end]
    # Only the pixels are large: the library reads a copy of all other fields.
    try:
        image = RawImage.FromString(bytes(others))
    except DecodeError as error:
        raise ValueError(f"no foxglove.RawImage: {error}") from None
    time = UtcNs(image.timestamp.ToNanoseconds())
    return ImageView(time, image.height, image.width, image.step, image.encoding, pixels)


def pixels(image: ImageView) -> Stored:
    """The pixels of an image in place, (rows, columns).

    Raises:
        ValueError: the image has another encoding, gaps between its rows, or not as many pixels as it says.
    """
    kind = image.kind
    if image.step != image.columns * kind.size:
        raise ValueError(f'the image is "{image.encoding}" with {image.step} bytes per row, not without gaps')
    wanted = image.rows * image.step
    if len(image.pixels) != wanted:
        raise ValueError(f"the image has {len(image.pixels) // kind.size} pixels instead of {wanted // kind.size}")
    return np.frombuffer(image.pixels, kind.dtype).reshape(image.rows, image.columns)
