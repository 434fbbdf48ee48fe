"""Makes a whole log of an unfinished or damaged one: closed, indexed, everything in it checked.

Reads the log once, from front to back, and writes what is sound into a new log with the recorder's own writer, so
that memory does not grow with the log.

Of a pulse whose pixels are lost, the tag is kept if it can be found: a tag is small beside its image, so what damages
a chunk seldom damages its tag. A tag that is found in damaged bytes is believed only if the head of its message gives
the same pulse and time: then neither was hit.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np
from mcap.opcode import Opcode
from msgspec.structs import replace
from numpy.typing import NDArray

from recorder.checking.verify import Findings
from recorder.log.mcap_layout import MESSAGE, PADDING_OPCODE, PAGE, RECORD, TAG_CHANNEL
from recorder.log.session_changes import session_changes
from recorder.reading.log_reader import Chunk, Item, LogReader, Message, SmallRecord
from recorder.reading.records import Damage
from recorder.reading.triplets import decoded_tag, pixels, tag_of, view_image
from recorder.recovering.rebuilt_log import RebuiltLog
from rig.errors import BadInputError
from rig.events import Event, Level
from rig.frame import FrameStatus
from rig.pulse import PulseNumber
from rig.tag import CameraTag, TripletTag
from rig.topics import TAG, TRIPLET
from triggering.ledger import Ledger, numbers, runs_to_text

_PULSES_MAX: Final = 10_000
#: An unfinished record of these kinds, at most so long, at the end of a log held no data.
_WITHOUT_DATA: Final = (PADDING_OPCODE, Opcode.MESSAGE_INDEX, Opcode.DATA_END)
_WITHOUT_DATA_MAX: Final = 2 * PAGE
#: Damaged bytes are searched in pieces of this size for tags that begin like this and are at most so long.
_PIECE: Final = 4 << 20
_TAG_BEGINS: Final = b'{"pulse":'
_TAG_MAX: Final = 1 << 16


@dataclass(frozen=True, slots=True)
class RecoverReport:
    """What was recovered.

    Attributes:
        source: the log that was read.
        path: the log that was written.
        bytes: size of the log that was written.
        was_closed: the source had been closed properly.
        ledger: what became of every pulse, as the new log has it; pulses without a tag are lost.
        lost_pixels: runs of pulses, (first, last), whose tag was found but not their image.
        findings: what could not be read, one sentence each.
    """

    source: Path
    path: Path
    bytes: int
    was_closed: bool
    ledger: Ledger
    lost_pixels: tuple[tuple[int, int], ...]
    findings: tuple[str, ...]

    @property
    def lossless(self) -> bool:
        """Whether everything that the source held is in the new log."""
        return not (self.ledger.missing or self.lost_pixels or self.findings)

    def in_words(self) -> str:
        """What was lost, in one line."""
        parts = [f"pulses {runs_to_text(self.ledger.missing)} altogether"] if self.ledger.missing else []
        parts += [f"the images of pulses {runs_to_text(self.lost_pixels)}"] if self.lost_pixels else []
        parts += [f"{self.findings[0]}{' and more' if len(self.findings) > 1 else ''}"] if self.findings else []
        return "; ".join(parts) or "nothing"

    def to_json(self) -> dict[str, Any]:
        """The report as one JSON object."""
        return {
            "source": str(self.source),
            "log": str(self.path),
            "bytes": self.bytes,
            "was_closed": self.was_closed,
            "lossless": self.lossless,
            **self.ledger.counts().model_dump(),
            "lost_pulses": numbers(self.ledger.missing, _PULSES_MAX),
            "lost_pixels": numbers(self.lost_pixels, _PULSES_MAX),
            "findings": list(self.findings),
        }


def recover(source: Path, target: Path, progress: Callable[[int], None] | None = None) -> RecoverReport:
    """Write everything of `source` that is sound into a new log.

    Args:
        source: the log; it is only read.
        target: must not exist.
        progress: called with the number of bytes of the source read so far.

    Raises:
        BadInputError: no such file, no pulse of a log of svev in it, or the target exists or cannot be made.
        StorageError: the disk refuses; the target is removed.
    """
    with LogReader(source, salvage=True) as reader, RebuiltLog(target, reader, session_changes(source)) as rebuilt:
        recovery = _Recovery(reader, rebuilt)
        for item in reader.items():
            recovery.take(item)
            if progress is not None:
                progress(item.offset + item.length)
        size = recovery.finish()
        return RecoverReport(
            source, target, size, reader.closed, recovery.ledger, recovery.lost_pixels, recovery.findings.lines()
        )


class _Recovery:
    """Takes item after item of the old log, in its order, and writes what is sound.

    Attributes:
        ledger: the pulses that have been written.
        findings: what could not be read, except pulses.
    """

    def __init__(self, reader: LogReader, rebuilt: RebuiltLog) -> None:
        self._reader, self._rebuilt = reader, rebuilt
        self.ledger = Ledger()
        self.findings = Findings()
        self._last: TripletTag | None = None
        self._lost: list[int] = []
        self._data_ended = False

    @property
    def lost_pixels(self) -> tuple[tuple[int, int], ...]:
        """Runs of pulses whose image is lost, as (first, last)."""
        breaks = [0, *(place for place, (a, b) in enumerate(pairwise(self._lost), 1) if b != a + 1), len(self._lost)]
        return tuple((self._lost[begin], self._lost[end - 1]) for begin, end in pairwise(breaks) if end > begin)

    def take(self, item: Item) -> None:
        """Write what is sound in an item of the old log."""
        match item:
            case Chunk(flaw="") as chunk:
                self._chunk(chunk)
            case Chunk() as chunk:
                self._salvage(chunk, chunk.flaw, chunk.messages)
            case Damage() as damage if not self._data_ended and not self._held_nothing(damage):
                self._salvage(damage, damage.text, ())
            case SmallRecord(opcode=Opcode.DATA_END):
                self._data_ended = True

    def finish(self) -> int:
        """Close the new log, which says where it comes from and what is lost.

        Returns:
            Its size in bytes.

        Raises:
            BadInputError: no pulse could be read.
            StorageError: the disk refuses.
        """
        if self._last is None:
            raise BadInputError(
                f"{self._reader.path}: no pulse of a log of svev can be read; nothing is recovered, name another file"
            )
        lost = {"lost_pulses": runs_to_text(self.ledger.missing), "lost_pixels": runs_to_text(self.lost_pixels)}
        name, time = self._reader.path.name, datetime.now(UTC).isoformat(timespec="seconds")
        words = ", ".join(f"{key.replace('_', ' ')} {pulses}" for key, pulses in lost.items() if pulses)
        level = Level.WARNING if words or self.findings.total else Level.INFO
        event = Event.now(level, "recover", f"recovered from {name}: {words or 'no pulse is lost'}")
        return self._rebuilt.close({"source": name, "time": time, **lost}, event)

    def _chunk(self, chunk: Chunk) -> None:
        images = chunk.images
        for message in chunk.messages:
            if message.topic == TRIPLET.name:
                continue
            if message.topic != TAG.name:
                if not self._rebuilt.other(message):
                    self.findings.add(f"a message on {message.topic}, which no log of this version has, is left out")
            elif (tag := tag_of(message)) is None:
                self.findings.add(f"pulse {message.sequence}: its tag cannot be read")
            else:
                self._pulse(tag, message, images.get(tag.pulse))

    def _pulse(self, tag: TripletTag, message: Message | None, image: Message | None) -> None:
        """Write one pulse; `message` is that of its tag, None if the tag was found in damaged bytes."""
        if self._last is not None and (tag.pulse <= self._last.pulse or tag.time <= self._last.time):
            self.findings.add(f"pulse {tag.pulse}: it comes twice or out of order, and is left out")
            return
        picture = None if image is None else _picture(image, tag)
        if picture is None and any(camera.status is FrameStatus.OK for camera in tag.cameras):
            self._lost.append(tag.pulse)
            tag, message = _without_pixels(tag), None
        self._last = tag
        self.ledger.add(tag)
        self._rebuilt.pulse(tag, picture, message)

    def _salvage(self, damaged: Chunk | Damage, why: str, messages: tuple[Message, ...]) -> None:
        """Look for tags in a damaged part of the log, and write their pulses without pixels."""
        tags = list(_salvaged_tags(self._reader, damaged.offset, damaged.length))
        if not tags and self._last is not None and (tag := _tag_from_heads(messages, self._last)) is not None:
            tags = [tag]
            self._lost.append(tag.pulse)
        for tag in tags:
            self._pulse(tag, None, None)
        if not tags:
            self.findings.add(f"{damaged.length} bytes from byte {damaged.offset} on: {why}")

    def _held_nothing(self, damage: Damage) -> bool:
        """Whether a torn end is that of a record without data, or too short to tell what record it was."""
        if not damage.torn or self._reader.closed or damage.length > _WITHOUT_DATA_MAX:
            return False
        return damage.length < RECORD.size or self._reader.read(damage.offset, 1)[0] in _WITHOUT_DATA


def _picture(image: Message, tag: TripletTag) -> NDArray[np.uint8] | None:
    """The pixels of an image message, None if it is damaged or has another shape than its tag says."""
    try:
        found = pixels(view_image(image.data or memoryview(b"")))
    except ValueError:
        return None
    return found if found.shape == tag.shape else None


def _salvaged_tags(reader: LogReader, offset: int, length: int) -> Iterator[TripletTag]:
    """The tags that are whole in `length` bytes of a log from `offset` on."""
    overlap = MESSAGE.size + _TAG_MAX
    for begin in range(offset, offset + length, _PIECE):
        piece = bytes(reader.read(begin, min(_PIECE + overlap, offset + length - begin)))
        place = piece.find(_TAG_BEGINS)
        while 0 <= place < _PIECE + MESSAGE.size:
            if place >= MESSAGE.size and (tag := _tag_at(piece, place)) is not None:
                yield tag
            place = piece.find(_TAG_BEGINS, place + 1)


def _tag_from_heads(messages: Sequence[Message], like: TripletTag) -> TripletTag | None:
    """A tag for a pulse whose tag is destroyed, if the heads of its two messages agree on number and time.

    Args:
        messages: the messages of a chunk, as far as they could be read.
        like: an earlier tag of the recording, which says what cameras there are.

    Returns:
        A tag in which the frames of all cameras are damaged; None if the heads do not agree.
    """
    for one, other in pairwise(messages):
        if (one.sequence, one.publish_time) == (other.sequence, other.publish_time) and one.channel == TAG_CHANNEL:
            tag = replace(like, pulse=PulseNumber(one.sequence), time=one.publish_time)
            return _without_pixels(tag, everything=True)
    return None


def _without_pixels(tag: TripletTag, *, everything: bool = False) -> TripletTag:
    """The tag of a pulse whose pixels are lost: frames that were ok are damaged; all frames are, if `everything`."""
    cameras = tuple(
        CameraTag(camera.name, camera.columns, FrameStatus.DAMAGED)
        if everything or camera.status is FrameStatus.OK
        else camera
        for camera in tag.cameras
    )
    return replace(tag, cameras=cameras)


def _tag_at(piece: bytes, place: int) -> TripletTag | None:
    """The tag at `place`, None if it is not whole or does not fit the head of the message before it."""
    opcode, length, channel, sequence, _, publish_time = MESSAGE.unpack_from(piece, place - MESSAGE.size)
    end = place - MESSAGE.size + RECORD.size + length
    if opcode != Opcode.MESSAGE or channel != TAG_CHANNEL or not place < end <= min(len(piece), place + _TAG_MAX):
        return None
    tag = decoded_tag(piece[place:end])
    return tag if tag is not None and (tag.pulse, tag.time) == (sequence, publish_time) else None
