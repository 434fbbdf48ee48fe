"""Makes a whole log of an unfinished or damaged one: closed, indexed, everything in it checked.

Reads the log once, from front to back, and writes what is sound into a new one with the recorder's own writer, so
that memory does not grow with the log. Of a pulse whose pixels are lost the tag stays, if it can be found.
"""

from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from recorder.events import Event, Level
from recorder.findings import Findings
from recorder.ledger import Ledger, numbers, runs_to_text
from recorder.log_items import Chunk, Damage, Item, Message, Small
from recorder.log_reader import LogReader, tag_of
from recorder.mcap_layout import PADDING_OPCODE, PAGE, RECORD
from recorder.raw_image import pixels, view_image
from recorder.rebuilt_log import RebuiltLog
from recorder.salvage import salvaged_tags, tag_from_heads, without_pixels
from recorder.session_changes import session_changes
from rig.errors import BadInputError
from rig.frame import FrameStatus
from rig.tag import TripletTag
from rig.topics import RECOVERY_METADATA, TAG, TRIPLET

_PULSES_MAX: Final = 10_000
#: An unfinished record of these kinds at the end of a log held nothing that is missed.
_TORN_MAX: Final = 2 * PAGE
_NOTHING_IN_IT: Final = (PADDING_OPCODE, Opcode.MESSAGE_INDEX, Opcode.DATA_END)


@dataclass(frozen=True, slots=True)
class RecoverReport:
    """What was recovered.

    Attributes:
        source: the log that was read.
        path: the log that was written.
        bytes: its size.
        was_closed: the source had been closed properly.
        ledger: what became of every pulse, as the new log has it; pulses without a tag are lost.
        lost_pixels: pulses whose tag was found, but not their image, as (first, last).
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
        """Nothing that the source held is missing."""
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
            **self.ledger.counts(),
            "lost_pulses": numbers(self.ledger.missing, _PULSES_MAX),
            "lost_pixels": numbers(self.lost_pixels, _PULSES_MAX),
            "findings": list(self.findings),
        }


def recover(source: Path, target: Path, progress: Callable[[int], None] | None = None) -> RecoverReport:
    """Write everything of `source` that is sound into a new log.

    Args:
        source: the log; it is only read.
        target: must not exist.
        progress: told how many bytes of the source have been read.

    Raises:
        BadInputError: no such file, nothing of a log of svev in it, or the target exists or cannot be made.
        StorageError: the disk refuses; the target is removed.
    """
    with LogReader(source, salvage=True) as reader, RebuiltLog(target, reader, session_changes(source)) as rebuilt:
        recovery = _Recovery(reader, rebuilt)
        for item in reader.items():
            recovery.take(item)
            if progress is not None:
                progress(item.offset + item.length)
        recovery.finish()
        return RecoverReport(
            source, target, rebuilt.close(), reader.closed, recovery.ledger, recovery.lost_pixels,
            recovery.findings.lines(),
        )  # fmt: skip


class _Recovery:
    """Takes the items of the old log in its order.

    Attributes:
        ledger: the pulses that have been written.
        findings: what could not be read, beside pulses.
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
        """Runs of pulses whose image is lost."""
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
            case Small(opcode=Opcode.DATA_END):
                self._data_ended = True

    def finish(self) -> None:
        """Say in the new log where it comes from and what is lost.

        Raises:
            BadInputError: there is no pulse.
        """
        if self._last is None:
            raise BadInputError(
                f"{self._reader.path}: no pulse of a log of svev can be read; nothing is recovered, name another file"
            )
        lost = {"lost_pulses": runs_to_text(self.ledger.missing), "lost_pixels": runs_to_text(self.lost_pixels)}
        self._rebuilt.set_metadata(
            RECOVERY_METADATA,
            {"source": self._reader.path.name, "time": datetime.now(UTC).isoformat(timespec="seconds"), **lost},
        )
        words = ", ".join(f"{name.replace('_', ' ')} {pulses}" for name, pulses in lost.items() if pulses)
        level = Level.WARNING if words or self.findings.total else Level.INFO
        self._rebuilt.event(
            Event.now(level, "recover", f"recovered from {self._reader.path.name}: {words or 'no pulse is lost'}")
        )

    def _chunk(self, chunk: Chunk) -> None:
        images = {message.sequence: message for message in chunk.messages if message.topic == TRIPLET.name}
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
        """Write one pulse; `message` is that of its tag, None if that was salvaged."""
        if self._last is not None and (tag.pulse <= self._last.pulse or tag.time <= self._last.time):
            self.findings.add(f"pulse {tag.pulse}: it comes twice or out of order, and is left out")
            return
        picture = None if image is None else _picture(image, tag)
        if picture is None and any(camera.status is FrameStatus.OK for camera in tag.cameras):
            self._lost.append(tag.pulse)
            tag, message = without_pixels(tag), None
        self._last = tag
        self.ledger.add(tag)
        self._rebuilt.pulse(tag, picture, message)

    def _salvage(self, damaged: Chunk | Damage, why: str, messages: tuple[Message, ...]) -> None:
        """Look for tags where something is destroyed."""
        tags = list(salvaged_tags(self._reader, damaged.offset, damaged.length))
        if not tags and self._last is not None and (tag := tag_from_heads(messages, self._last)) is not None:
            tags = [tag]
            self._lost.append(tag.pulse)
        for tag in tags:
            self._pulse(tag, None, None)
        if not tags:
            self.findings.add(f"{damaged.length} bytes from byte {damaged.offset} on: {why}")

    def _held_nothing(self, damage: Damage) -> bool:
        """Whether a torn end is of a record that only helps to read others, or too short to say what it was."""
        if not damage.torn or self._reader.closed or damage.length > _TORN_MAX:
            return False
        return damage.length < RECORD.size or self._reader.read(damage.offset, 1)[0] in _NOTHING_IN_IT


def _picture(image: Message, tag: TripletTag) -> NDArray[np.uint8] | None:
    """The pixels of an image message, None if they are not those that its tag tells of."""
    try:
        found = pixels(view_image(image.data or memoryview(b"")))
    except ValueError:
        return None
    return found if found.shape == tag.shape else None
