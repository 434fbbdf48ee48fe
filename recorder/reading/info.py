"""Says in a moment what a log holds: reads its tags and health records, no pixels."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from recorder.log.extent import (
    NEXT_PART,
    apply_extent,
    disk_trouble,
    ended_early_said,
    forgotten_s,
    part_number,
)
from recorder.log.session_changes import session_changes
from recorder.log.write_lock import is_being_written
from recorder.reading.items import Chunk, Message
from recorder.reading.log_reader import LogReader
from recorder.reading.parts import RecordingReader, missing_after, missing_before
from recorder.reading.records import Damage
from recorder.reading.triplets import health_of, tag_of
from rig.host.utc_clock import UtcState
from rig.phrase import NOTHING, Phrase, phrase
from rig.tag import TripletTag
from rig.topics import (
    COMPACT_METADATA,
    HEALTH,
    IMPORT_METADATA,
    MERGE_METADATA,
    RECORDING_METADATA,
    RECOVERY_METADATA,
    RIG_METADATA,
    SESSION_METADATA,
    TAG,
)
from rig.transport import wire
from triggering.ledger.account import Ledger, runs_from_text
from triggering.ledger.recounted import SourceAccount
from triggering.ledger.source_recount import SourceRecount


@dataclass(frozen=True, slots=True)
class LogInfo:
    """What a log holds.

    Attributes:
        path: the log.
        bytes: size of the file.
        closed: the recorder closed the log properly.
        being_written: a program is writing the log.
        truncated: the log ends in the middle of a record.
        damaged_bytes: bytes that could not be read.
        torn_bytes: how many of them are an unfinished record at the end; every log that was not closed may have one.
        ledger: what became of every pulse.
        first: tag of the first pulse, None if there is no pulse.
        session: fields of the last session record, with the changes that were made after the recording.
        rig: fields of the last rig record.
        known_lost: runs of pulses without a tag of which the log itself says that they were lost (`svev recover`).
        merged: of a log that was made of two: fields that say which, and how their clocks differed; empty otherwise.
        imported: of a log that was made of films: fields that name it, and say that no trigger made its pulses; empty
            otherwise.
        compacted: of a log whose images are coded: fields that say of which log, and how; empty otherwise.
        disk: what went wrong with the disk while the log was written; empty text if nothing.
        forgotten_s: after so many seconds the recording ended by itself, because nobody had stopped it; 0: otherwise.
        ended_early_said: why the log ends before its recording was to end, or that this is not known; empty text: as
            was wanted.
        part_before: id of the log that this one continues and that does not lie beside it; empty: none is missed.
        part: which part of a split recording the log is; 1 also if it is whole.
        next_part: id of the part in which the recording goes on; empty: in none, or the log was not closed.
        part_after: the same if that does not lie beside this log; empty: none is missed.
        messages: number of messages per topic.
        library: the program that wrote the log.
        source: what the source of the pulses told of them, beside the tags; None: it tells nothing, the log does not
            hold it, or it was not asked for.
    """

    path: Path
    bytes: int
    closed: bool
    being_written: bool
    truncated: bool
    damaged_bytes: int
    torn_bytes: int
    ledger: Ledger
    first: TripletTag | None
    session: dict[str, str]
    rig: dict[str, str]
    known_lost: tuple[tuple[int, int], ...]
    merged: dict[str, str]
    imported: dict[str, str]
    compacted: dict[str, str]
    disk: Phrase
    forgotten_s: float
    ended_early_said: Phrase
    part_before: str
    part: int
    next_part: str
    part_after: str
    messages: dict[str, int]
    library: str
    source: SourceAccount | None = None

    @property
    def trouble(self) -> str:
        """What went wrong with the disk while the log was written, in one line; empty if nothing."""
        return self.disk.text

    @property
    def ended_early(self) -> str:
        """Why the log ends before its recording was to end, in one line; empty: it ended as was wanted."""
        return self.ended_early_said.text

    @property
    def part_said(self) -> Phrase:
        """Which part of a recording the log is, of which others do not lie beside it; empty text: of none."""
        missing = " and ".join(filter(None, (self.part_before, self.part_after)))
        if not missing:
            return NOTHING
        text = "it is part {part} of a recording, and {missing} does not lie beside it: put all parts into one folder"
        return phrase("log_part", text, part=self.part, missing=missing)

    @property
    def recording(self) -> str:
        """Id of the recording, empty if there is no pulse."""
        return self.first.recording if self.first else ""

    @property
    def shape(self) -> tuple[int, int] | None:
        """Rows and columns of the triplets, None if there is no pulse."""
        return self.first.shape if self.first else None

    @property
    def cameras(self) -> tuple[str, ...]:
        """Names of the cameras, left to right."""
        return tuple(camera.name for camera in self.first.cameras) if self.first else ()

    @property
    def utc(self) -> UtcState | None:
        """How well the recording computer knew UTC; None: the log does not say."""
        return UtcState.from_fields(self.rig)

    @property
    def missing_pulses(self) -> int:
        """Number of pulses without a tag."""
        return sum(last - first + 1 for first, last in self.ledger.missing)

    def to_json(self) -> dict[str, Any]:
        """The information as one JSON object."""
        ledger = self.ledger
        return {
            "log": str(self.path),
            "closed": self.closed,
            "being_written": self.being_written,
            "truncated": self.truncated,
            "damaged_bytes": self.damaged_bytes,
            **ledger.counts().model_dump(),
            "ledger": ledger.states(self.cameras),
            "missing_pulses": self.missing_pulses,
            "pauses": [wire.to_builtins(pause) for pause in ledger.pauses()],
            "bytes": self.bytes,
            "recording": self.recording,
            "start_ns": None if ledger.first_time is None else str(ledger.first_time),
            "duration_s": round(ledger.duration_s, 6),
            "rate_hz": None if ledger.rate_hz is None else round(ledger.rate_hz, 4),
            "source": None if self.source is None else self.source.to_json(),
            "offset_us": ledger.spread.figures(),
            "shape": None if self.shape is None else list(self.shape),
            "cameras": list(self.cameras),
            "session": self.session,
            "rig": self.rig,
            "utc": None if self.utc is None else asdict(self.utc),
            "merged": self.merged,
            "imported": self.imported,
            "compacted": self.compacted,
            "trouble": self.trouble,
            "ended_early": self.ended_early,
            "part": self.part,
            "part_before": self.part_before,
            "part_after": self.part_after,
            "messages": self.messages,
            "library": self.library,
        }


def info(
    path: Path, *, original: bool = False, source: bool = False, links: bool = True, whole: bool = False
) -> LogInfo:
    """Read what a log says about itself, and count its pulses by their tags.

    The time this takes depends on the number of pulses, not on the size of the log. Nothing is checked: `verify` does
    that.

    Args:
        path: the log.
        original: give the session as the log has it, without the changes in the file beside it.
        links: whether a link of this name is followed.
        source: compare the tags with what the source of the pulses told, too.
        whole: of all parts of a split recording, of which `path` is one.

    Raises:
        BadInputError: no such file, no MCAP log, not one of ours, or the file of session changes is broken.
    """
    ledger, first = Ledger(), None
    told = SourceRecount() if source else None
    messages: dict[str, int] = {}
    damaged = torn = 0
    with (RecordingReader if whole else LogReader)(path, skim=True, links=links) as reader:
        for item in reader.items(only=(TAG.name, HEALTH.name) if source else (TAG.name,)):
            if isinstance(item, Damage):
                damaged += item.length
                torn += item.length if item.torn else 0
            elif isinstance(item, Chunk):
                damaged += item.length if item.flaw else 0
                for message in item.messages:
                    messages[message.topic] = messages.get(message.topic, 0) + 1
                    tag = tag_of(message)
                    if tag is not None:
                        first = first or tag
                        ledger.add(tag)
                    if told is not None:
                        _tell(told, tag, message)
        apply_extent(reader.metadata, ledger)
        if MERGE_METADATA in reader.metadata:
            told = None  # the health records of two computers have two clocks
        session = reader.metadata.get(SESSION_METADATA, {}) | ({} if original else session_changes(reader.path))
        last = reader.paths[-1] if isinstance(reader, RecordingReader) else path
        being_written = not reader.closed and is_being_written(last)
        return LogInfo(
            path, reader.size, reader.closed, being_written, reader.truncated, damaged, torn, ledger, first, session,
            reader.metadata.get(RIG_METADATA, {}), known_lost(reader), reader.metadata.get(MERGE_METADATA, {}),
            reader.metadata.get(IMPORT_METADATA, {}), reader.metadata.get(COMPACT_METADATA, {}),
            disk_trouble(reader.metadata), forgotten_s(reader.metadata), ended_early_said(reader.metadata),
            missing_before(reader.metadata, reader.path), part_number(session),
            reader.metadata.get(RECORDING_METADATA, {}).get(NEXT_PART, ""), missing_after(reader.metadata, last),
            messages, reader.library,
            None if told is None else told.finish(),
        )  # fmt: skip


def _tell(source: SourceRecount, tag: TripletTag | None, message: Message) -> None:
    """Hand a tag, or a message that may be a health record, to the account of the source."""
    if tag is not None:
        source.add(tag)
    elif message.topic == HEALTH.name and (health := health_of(message)) is not None:
        source.reported(health, message.log_time)


def known_lost(reader: LogReader) -> tuple[tuple[int, int], ...]:
    """Runs of pulses of which a log, read to its end, says that they were lost when it was recovered."""
    return tuple(runs_from_text(reader.metadata.get(RECOVERY_METADATA, {}).get("lost_pulses", "")))


def merged_in_words(merged: Mapping[str, str]) -> str:
    """What a log says of the logs that it was merged from, in one line."""
    one, two, common, offset, sigma = (
        merged.get(key, "?") for key in ("source_1", "source_2", "common", "offset_ms", "offset_sigma_us")
    )
    where = "ahead of" if offset.startswith("-") else "behind"
    return (
        f"merged from {one} and {two}: {common} pulses are in both; the clock of the second was "
        f"{offset.lstrip('-')} ms (+- {sigma} us) {where} that of the first"
    )


def imported_in_words(imported: Mapping[str, str]) -> str:
    """What a log says of the films that it was made of, in one line."""
    synchrony, start, date = (imported.get(key, "?") for key in ("synchrony", "start", "date"))
    return (
        f"imported from films, without a trigger: pulses are told by frame number from a common start by {start}; how "
        f"synchronous the cameras were is {synchrony}; the date is {date}"
    )


def compacted_in_words(compacted: Mapping[str, str]) -> str:
    """What a log says of the log that it was compacted from, in one line."""
    source, size, codec = (compacted.get(key, "?") for key in ("source", "bytes", "codec"))
    return f"from {source} ({size} bytes): every frame without loss, coded by {codec}"
