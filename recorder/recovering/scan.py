"""Reads a log in any state from its first byte to its last, and notes where something of each pulse stands.

Chunks are believed by their checksums and found at any offset, whatever stands around them: inside of other chunks,
behind zeroed padding, or where a block of the file was copied to.
"""

from collections.abc import Callable
from typing import Final

from isal.isal_zlib import crc32
from mcap.opcode import Opcode
from mcap.records import DataEnd

from recorder.checking.verify import Findings
from recorder.log.channels import CALIBRATION_TOPIC
from recorder.log.crc import combined_crc
from recorder.log.mcap_layout import MAGIC, PADDING_OPCODE, PAGE, RECORD
from recorder.reading.items import Chunk, Message, SmallRecord
from recorder.reading.log_reader import LogReader, stream
from recorder.reading.records import Damage
from recorder.reading.triplets import images_of, pixels, tag_of, view_image
from recorder.recovering.salvage import pulse_of, tags_in
from recorder.recovering.sightings import Constants, Rank, Sighting
from rig.frame import FrameStatus
from rig.images.pixels import Stored
from rig.tag import TripletTag
from rig.topics import CAMERA_TOPIC, NOTES, RESULTS, TAG, TRIPLET

#: An unfinished record of these kinds, at most so long, at the end of a log held no data.
_WITHOUT_DATA: Final = (PADDING_OPCODE, Opcode.MESSAGE_INDEX, Opcode.DATA_END)
_WITHOUT_DATA_MAX: Final = 2 * PAGE
#: Where so many bytes are no chunk, the checksum over everything tells nothing that is not known.
_BETWEEN_MAX: Final = 64 << 20


class Scan:
    """One reading of a log.

    Attributes:
        sightings: of all pulses, in the order of the file.
        others: offset and length of the sound chunks that hold events or health records, in the order of the file.
        calibrations: serialized `foxglove.CameraCalibration` by camera name.
        findings: what cannot be read and is not of a pulse that was seen, one sentence each.
    """

    def __init__(self, reader: LogReader, progress: Callable[[int], None]) -> None:
        """Read the log; metadata and attachments are in the reader afterwards.

        Raises:
            BadInputError: the disk cannot read the file.
        """
        self.sightings: list[Sighting] = []
        self.others: list[tuple[int, int]] = []
        self.calibrations: dict[str, bytes] = {}
        self.findings = Findings()
        self._reader = reader
        self._constants: dict[Constants, Constants] = {}
        self._crc: int | None = 0
        self._read_declarations()
        begin = 0
        while (chunk := reader.next_sound_chunk(begin)) is not None:
            self._chunk(chunk)
            self._between(begin, chunk.offset)
            self._cover_chunk(chunk)
            begin = chunk.offset + chunk.length
            progress(begin)
        self._between(begin, reader.size)

    def _read_declarations(self) -> None:
        """Let the reader see the channels, which are declared before the first chunk."""
        for item in self._reader.items_between(len(MAGIC), self._reader.size):
            if isinstance(item, Chunk):
                return

    def _chunk(self, chunk: Chunk) -> None:
        images, others = images_of(chunk), False
        for message in chunk.messages:
            if message.topic == TAG.name:
                tag = tag_of(message)
                if tag is None:
                    self.findings.add(f"pulse {message.sequence}: its tag cannot be read")
                elif is_whole(tag, images.get(tag.pulse)):
                    self._see(tag, Rank.WHOLE, chunk.offset, chunk.length, chunk.crc)
                else:
                    self._see(tag, Rank.TAG, message.offset, message.length)
            elif message.topic in (*NOTES, *RESULTS):
                others = True
            elif message.topic.startswith(CALIBRATION_TOPIC):
                camera = message.topic.removeprefix(CALIBRATION_TOPIC)
                self.calibrations.setdefault(camera, bytes(message.data or b""))
            elif message.topic != TRIPLET.name and not message.topic.startswith(CAMERA_TOPIC):
                self.findings.add(f"a message on {message.topic}, which no log of this version has, is left out")
        if others:
            self.others.append((chunk.offset, chunk.length))

    def _between(self, begin: int, end: int) -> None:
        """Take what stands between two sound chunks, before the first or after the last."""
        data_end: SmallRecord | None = None
        last = end == self._reader.size
        if begin == 0 and bytes(self._reader.read(0, len(MAGIC))) == MAGIC:
            begin = len(MAGIC)
            self._crc = crc32(MAGIC)
        for item in self._reader.items_between(begin, end):
            if data_end is not None:
                break
            match item:
                case Chunk() as chunk:
                    self._damaged(chunk, chunk.flaw or "it has no checksum", chunk.messages)
                case Damage() as damage if not self._held_nothing(damage):
                    self._damaged(damage, damage.text, ())
                case SmallRecord(opcode=Opcode.DATA_END) as record if last:
                    data_end = record
                case SmallRecord(opcode=Opcode.MESSAGE) as record:
                    self.findings.add(f"message at byte {record.offset}: stands outside of a chunk, left out")
        self._cover(begin, end if data_end is None else data_end.offset)
        if data_end is not None:
            self._check(DataEnd.read(stream(data_end.body)))

    def _damaged(self, damaged: Chunk | Damage, why: str, messages: tuple[Message, ...]) -> None:
        """Look for pulses in a damaged part of the log."""
        offset, length = damaged.offset, damaged.length
        heads = pulse_of(messages)
        found = False
        for tag in tags_in(self._reader, offset, length):
            self._see(tag.tag, Rank.TAG, tag.offset, tag.length)
            found = True
        if found:
            return
        if heads is not None:
            self.sightings.append(Sighting(*heads, Rank.HEADS, offset, length, None))
        elif isinstance(damaged, Damage) and damaged.torn:
            self.findings.add(f"the last {length} bytes, from byte {offset} on, are an unfinished record")
        else:
            self.findings.add(f"{length} bytes from byte {offset} on: {why}")

    def _see(self, tag: TripletTag, rank: Rank, offset: int, length: int, crc: int = 0) -> None:
        constants = Constants.of(tag)
        constants = self._constants.setdefault(constants, constants)
        self.sightings.append(Sighting(tag.pulse, tag.time, rank, offset, length, constants, crc))

    def _held_nothing(self, damage: Damage) -> bool:
        """Whether a torn end is that of a record without data, too short to tell of what record, or still growing."""
        if not damage.torn or self._reader.closed:
            return False
        if self._reader.has_grown():
            return True
        if damage.length > _WITHOUT_DATA_MAX:
            return False
        return damage.length < RECORD.size or self._reader.read(damage.offset, 1)[0] in _WITHOUT_DATA

    def _cover(self, begin: int, end: int) -> None:
        """Take bytes that are no sound chunk into the checksum over everything."""
        if end - begin > _BETWEEN_MAX:
            self._crc = None
        if self._crc is not None:
            self._crc = crc32(self._reader.read(begin, end - begin), self._crc)

    def _cover_chunk(self, chunk: Chunk) -> None:
        if self._crc is not None:
            head = self._reader.read(chunk.offset, chunk.length - chunk.size)
            self._crc = combined_crc(crc32(head, self._crc), chunk.crc, chunk.size)

    def _check(self, data_end: DataEnd) -> None:
        """Say so if something is wrong that has not been found."""
        wrong = data_end.data_section_crc not in (0, self._crc) and self._crc is not None
        if wrong and not self.findings.total and all(sighting.rank is Rank.WHOLE for sighting in self.sightings):
            self.findings.add(
                "the checksum over everything is wrong, those of pulses and messages are right: session, rig or "
                "attachments may be false"
            )


def is_whole(tag: TripletTag, image: Message | None) -> bool:
    """Whether the image is there, if any camera delivered a frame."""
    if all(camera.status is not FrameStatus.OK for camera in tag.cameras):
        return True
    return image is not None and picture_of(image, tag) is not None


def picture_of(image: Message, tag: TripletTag) -> Stored | None:
    """The pixels of an image message, None if it is damaged or has another shape or encoding than its tag says."""
    try:
        view = view_image(image.data or memoryview(b""))
        found = pixels(view)
    except ValueError:
        return None
    return found if (found.shape, view.encoding) == (tag.shape, tag.pixels.encoding) else None
