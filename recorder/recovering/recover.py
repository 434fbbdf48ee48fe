"""Makes a whole log of an unfinished or damaged one: closed, indexed, everything in it checked.

Reads the log twice: first all of it, to find out where which pulse stands (`Scan`) and which of them belong together
(`chain_of`); then what is sound, pulse by pulse, which the recorder's own writer puts into a new log. Memory grows with
the number of pulses, not with the size of the log.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from typing import Final

from msgspec.structs import replace

from recorder.log.extent import END_UNKNOWN, ENDED_EARLY_SAID, as_field, last_before
from recorder.log.session_changes import session_changes
from recorder.log.write_lock import is_being_written
from recorder.reading.items import Message
from recorder.reading.log_reader import LogReader
from recorder.reading.triplets import images_of, read_tag, tag_of
from recorder.recovering.rebuilt_log import RebuiltLog
from recorder.recovering.scan import Scan, picture_of
from recorder.recovering.sightings import Chain, Rank, Sighting, chain_of
from recorder.recovering.unfinished_log import check_target
from recorder.writing.log_writer import LogDescription
from rig.errors import BadInputError
from rig.events import Event, Level
from rig.frame import FrameStatus
from rig.images.pixels import Stored
from rig.phrase import Phrase, phrase, plain
from rig.pulse import PulseNumber
from rig.tag import CameraTag, TripletTag
from rig.topics import (
    CALIBRATION_ATTACHMENT,
    COMPACT_METADATA,
    NOTES,
    RECOVERY_METADATA,
    RESULTS,
    RIG_ATTACHMENT,
    RIG_METADATA,
    SESSION_METADATA,
)
from triggering.ledger.account import Ledger, numbers, runs_to_text

_PULSES_MAX: Final = 10_000


@dataclass(frozen=True, slots=True)
class RecoverReport:
    """What was recovered.

    Attributes:
        source: the log that was read.
        path: the log that was written.
        bytes: size of the log that was written.
        was_closed: the source had been closed properly.
        was_written: a program was writing the source, so that more pulses come in it.
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
    was_written: bool = False

    @property
    def lossless(self) -> bool:
        """Whether everything that the source held is in the new log."""
        return not (self.ledger.missing or self.lost_pixels or self.findings)

    def in_words(self) -> str:
        """What was lost, in one line."""
        return _loss(self.ledger, self.lost_pixels, self.findings) or "nothing"

    @property
    def end_unknown(self) -> str:
        """What is not known of the end of the recording; empty: the source had been closed."""
        return "" if self.was_closed else _end_unknown(self.ledger, was_written=self.was_written).text

    def to_json(self) -> dict[str, object]:
        """The report as one JSON object."""
        return {
            "source": str(self.source),
            "log": str(self.path),
            "bytes": self.bytes,
            "was_closed": self.was_closed,
            "was_written": self.was_written,
            "end_unknown": self.end_unknown,
            "lossless": self.lossless,
            **self.ledger.counts().model_dump(),
            "lost_pulses": numbers(self.ledger.missing, _PULSES_MAX),
            "lost_pixels": numbers(self.lost_pixels, _PULSES_MAX),
            "findings": list(self.findings),
        }


def recover(source: Path, target: Path, progress: Callable[[int], None] | None = None) -> RecoverReport:
    """Write everything of `source` that is sound into a new log.

    Args:
        source: the log, which may still be written: then the new one says so; it is only read.
        target: must not exist.
        progress: called with the number of bytes of the source that are done.

    Raises:
        BadInputError: no such file, no pulse of a log of svev in it, or the target exists or cannot be made.
        StorageError: the disk refuses; the target is removed.
    """
    done = progress or (lambda _: None)
    was_written = is_being_written(source)
    with LogReader(source, salvage=True) as reader:
        check_target(target)
        changes = session_changes(source)
        scan = Scan(reader, lambda position: done(position // 2))
        chain = chain_of(scan.sightings)
        if chain is None:
            raise BadInputError(
                f"{source}: no pulse of a log of svev can be read; nothing is recovered, name another file"
            )
        attachments = reader.attachments
        description = LogDescription(
            session={**reader.metadata.get(SESSION_METADATA, {}), **changes},
            rig=reader.metadata.get(
                RIG_METADATA, {"cameras": ", ".join(each.name for each in chain.constants.cameras)}
            ),
            rig_toml=attachments.get(RIG_ATTACHMENT, b""),
            calibration_json=attachments.get(CALIBRATION_ATTACHMENT),
            calibrations=scan.calibrations,
            begin=chain.pulses[0].time,
        )
        found = chain.constants
        own_topics = [(camera.name, camera.columns) for camera in found.cameras] if reader.has_camera_topics else ()
        with RebuiltLog(target, description, found.shape, own_topics, found.pixels) as rebuilt:
            recovery = _Recovery(reader, rebuilt, chain, scan, was_written=was_written)
            recovery.write(lambda share: done(reader.size // 2 + round(reader.size / 2 * share)))
            size = recovery.finish()
        return RecoverReport(
            source,
            target,
            size,
            reader.closed,
            recovery.ledger,
            recovery.lost_pixels,
            recovery.findings.lines(),
            was_written,
        )


class _Recovery:
    """Writes the pulses of a chain, and what else the old log holds.

    Attributes:
        ledger: the pulses that have been written.
        findings: what could not be read, except pulses.
    """

    def __init__(self, reader: LogReader, rebuilt: RebuiltLog, chain: Chain, scan: Scan, *, was_written: bool) -> None:
        self._was_written = was_written
        self._reader, self._rebuilt, self._chain = reader, rebuilt, chain
        self._others = iter(scan.others)
        self._next_other = next(self._others, None)
        self._written: set[tuple[str, int, int]] = set()
        self.ledger = Ledger()
        first = chain.pulses[0].pulse if chain.pulses else PulseNumber(0)
        self.ledger.follows(last_before(reader.metadata, first))
        self.findings = scan.findings
        for text in chain.left_out:
            self.findings.add(text)
        self._lost: list[int] = []

    @property
    def lost_pixels(self) -> tuple[tuple[int, int], ...]:
        """Runs of pulses whose image is lost, as (first, last)."""
        breaks = [0, *(place for place, (a, b) in enumerate(pairwise(self._lost), 1) if b != a + 1), len(self._lost)]
        return tuple((self._lost[begin], self._lost[end - 1]) for begin, end in pairwise(breaks) if end > begin)

    def write(self, progress: Callable[[float], None]) -> None:
        """Write the pulses by number, and events and health records about where they stood between them.

        Args:
            progress: called with the share of the pulses that is done, 0 to 1.
        """
        pulses = self._chain.pulses
        for place, sighting in enumerate(pulses, 1):
            self._others_before(sighting.offset)
            self._pulse(sighting)
            progress(place / len(pulses))
        self._others_before(self._reader.size)

    def finish(self) -> int:
        """Close the new log, which says where it comes from and what is lost.

        Returns:
            Its size in bytes.

        Raises:
            StorageError: the disk refuses.
        """
        lost = {"lost_pulses": runs_to_text(self.ledger.missing), "lost_pixels": runs_to_text(self.lost_pixels)}
        name, time = self._reader.path.name, datetime.now(UTC).isoformat(timespec="seconds")
        words = _loss(self.ledger, self.lost_pixels, self.findings.lines())
        unknown = None if self._reader.closed else _end_unknown(self.ledger, was_written=self._was_written)
        end = {} if unknown is None else {END_UNKNOWN: unknown.text, ENDED_EARLY_SAID: as_field(unknown)}
        kept = "no pulse up to the last one is lost" if end else "no pulse is lost"
        told = f"this is lost: {words}" if words else kept
        told += f"; {unknown}" if unknown is not None else ""
        event = Event.now(
            Level.WARNING if words or end else Level.INFO, "recover", plain(f"recovered from {name} on {time}: {told}")
        )
        others = {
            key: each
            for key, each in self._reader.metadata.items()
            if key not in (SESSION_METADATA, RIG_METADATA, COMPACT_METADATA)
        }
        recovery = {"source": name, "time": time, **lost, **end}
        return self._rebuilt.close({**others, RECOVERY_METADATA: recovery}, event)

    def _pulse(self, sighting: Sighting) -> None:
        tag, picture, message = self._read(sighting)
        if picture is None and any(camera.status is FrameStatus.OK for camera in tag.cameras):
            tag, message = _without_pixels(tag), None
            self._lost.append(tag.pulse)
        elif sighting.rank is Rank.HEADS:
            self._lost.append(tag.pulse)
        try:
            self._rebuilt.pulse(tag, picture, message)
        except ValueError as error:
            self.findings.add(f"pulse {tag.pulse}: cannot be written ({error})")
        else:
            self.ledger.add(tag)

    def _read(self, sighting: Sighting) -> tuple[TripletTag, Stored | None, Message | None]:
        """Tag, pixels and tag message of a pulse, as far as they are there; valid until anything else is read."""
        match sighting.rank:
            case Rank.HEADS:
                return self._chain.constants.damaged_tag(sighting.pulse, sighting.time), None, None
            case Rank.TAG:
                return read_tag(bytes(self._reader.read(sighting.offset, sighting.length))), None, None
        chunk = self._reader.chunk(sighting.offset, sighting.length)
        for message in chunk.messages:
            tag = tag_of(message)
            if tag is not None and (tag.pulse, tag.time) == (sighting.pulse, sighting.time) and chunk.checked:
                image = images_of(chunk).get(tag.pulse)
                return tag, None if image is None else picture_of(image, tag), message
        raise BadInputError(
            f"{self._reader.path}: pulse {sighting.pulse} was read once and not a second time; look at `dmesg`"
        )

    def _others_before(self, offset: int) -> None:
        """Write events, health records and results from chunks before a place of the old log, each once."""
        while self._next_other is not None and self._next_other[0] < offset:
            for message in self._reader.chunk(*self._next_other).messages:
                key = message.topic, message.sequence, message.log_time
                if message.topic in (*NOTES, *RESULTS) and key not in self._written:
                    self._written.add(key)
                    data = bytes(message.data or b"")
                    sequence = message.sequence if message.topic in RESULTS else None
                    self._rebuilt.other(message.topic, data, message.publish_time, message.log_time, sequence)
            self._next_other = next(self._others, None)


def _end_unknown(ledger: Ledger, *, was_written: bool) -> Phrase:
    """Says of a log that was not closed that pulses are missing at its end, or may be."""
    last = ledger.last_pulse or 0
    if was_written:
        text = "it was still being written: more pulses came after pulse {last}"
        return phrase("why_still_written", text, last=last)
    text = "it was never closed: nobody knows whether pulses came after pulse {last}"
    return phrase("why_never_closed", text, last=last)


def _loss(ledger: Ledger, lost_pixels: Sequence[tuple[int, int]], findings: Sequence[str]) -> str:
    """What was lost, in one line; empty if nothing was."""
    parts = [f"pulses {runs_to_text(ledger.missing)} altogether"] if ledger.missing else []
    parts += [f"the images of pulses {runs_to_text(lost_pixels)}"] if lost_pixels else []
    parts += [f"{findings[0]}{' and more' if len(findings) > 1 else ''}"] if findings else []
    return "; ".join(parts)


def _without_pixels(tag: TripletTag) -> TripletTag:
    """The tag of a pulse whose pixels are lost: frames that were ok are damaged."""
    cameras = tuple(
        CameraTag(camera.name, camera.columns, FrameStatus.DAMAGED, rows=camera.rows)
        if camera.status is FrameStatus.OK
        else camera
        for camera in tag.cameras
    )
    return replace(tag, cameras=cameras)
