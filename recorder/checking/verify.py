"""Checks a log from the first to the last byte and says, pulse by pulse, what is missing."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

from recorder.checking.pulse_check import PulseCheck
from recorder.checking.structure_check import StructureCheck
from recorder.checking.time_line import TimeLine
from recorder.log.extent import apply_extent, ended_early
from recorder.log.write_lock import is_being_written
from recorder.reading.info import known_lost
from recorder.reading.items import Chunk, Item, printable
from recorder.reading.log_reader import LogReader
from recorder.reading.parts import missing_after, missing_before
from recorder.reading.records import Damage
from rig.events import Event
from rig.topics import MERGE_METADATA
from rig.transport import wire
from triggering.ledger.account import Ledger, numbers
from triggering.ledger.recounted import Recounted

_PULSES_MAX = 10_000
_FINDINGS_MAX = 500
_FINDING_MAX = 300
_STILL_WRITTEN = "the log is still being written: verify it when the recording has ended"
_STOPPED_SHORT = "the log was not closed: the recorder was stopped short"


class Findings:
    """What a check found wrong, one sentence each; keeps the first 500.

    Attributes:
        total: number of findings, kept or not.
    """

    def __init__(self) -> None:
        self.total = 0
        self._kept: list[str] = []

    def add(self, text: str) -> None:
        """Note one finding; names from the file, which may be in it, are shown and not obeyed by a terminal."""
        self.total += 1
        if len(self._kept) < _FINDINGS_MAX:
            self._kept.append(printable(text, _FINDING_MAX))

    def lines(self) -> tuple[str, ...]:
        """The findings that were kept; if there are more, the last line says how many."""
        more = self.total - len(self._kept)
        return (*self._kept, f"and {more} more") if more else tuple(self._kept)


class Verdict(StrEnum):
    """The result of `verify` in one word."""

    CLEAN = "clean"  #: every pulse complete, no pause, everything consistent
    PARTIAL = (
        "partial"  #: consistent; pulses lack frames, and their tags say which and why, or no pulses came for a while
    )
    CONTRADICTED = "contradicted"  #: sound, but frames are of other pulses, by their numbers, than their tags say
    DAMAGED = "damaged"  #: not closed, unreadable in part, or inconsistent


@dataclass(frozen=True, slots=True)
class VerifyReport:
    """What `verify` found.

    Attributes:
        path: the log.
        bytes: size of the file.
        closed: the log was closed properly.
        truncated: the log ends in the middle of a record.
        ledger: what became of every pulse, as the tags say.
        recounted: the same, recomputed from numbers and times of the frames.
        findings: what is wrong with the log itself, one sentence each.
        events: events in the log, the first thousand.
        every_byte: the log holds checksums over every byte of it; logs of earlier versions hold them over images, tags
            and messages, but not over metadata and what stands between chunks.
        known_lost: runs of pulses without a tag of which the log itself says that they were lost (`svev recover`).
        ended_early: why the log ends before its recording was to end, or that this is not known; empty: as was wanted.
        part_before: id of the log that this one continues and that does not lie beside it; empty: none is missed.
        part_after: id of the part in which this one goes on and that does not lie beside it; empty: none is missed.
        being_written: a program is writing the log.
        off_time: messages far outside of the pulses, one sentence each; nothing is wrong with the pulses.
        unclosed: the finding that the log is not closed; empty: it is.
    """

    path: Path
    bytes: int
    closed: bool
    truncated: bool
    ledger: Ledger
    recounted: Recounted
    findings: tuple[str, ...]
    events: tuple[Event, ...]
    every_byte: bool
    known_lost: tuple[tuple[int, int], ...] = ()
    ended_early: str = ""
    part_before: str = ""
    part_after: str = ""
    being_written: bool = False
    off_time: tuple[str, ...] = ()
    unclosed: str = ""

    @property
    def verdict(self) -> Verdict:
        """DAMAGED if the log is not sound, else CONTRADICTED if frames are of other pulses than their tags say.

        Otherwise CLEAN if nothing is missing, no time either, and PARTIAL if something is. What a log misses at
        its end, or before its beginning in another one, counts as missing too.
        """
        if self.findings or not self.closed or not set(self.ledger.missing) <= set(self.known_lost):
            return Verdict.DAMAGED
        if self.recounted.misfiled:
            return Verdict.CONTRADICTED
        whole = self.ledger.whole and not (self.part_before or self.part_after or self.ended_early)
        return Verdict.CLEAN if whole else Verdict.PARTIAL

    @property
    def damaged(self) -> bool:
        """Whether the log is not sound."""
        return self.verdict is Verdict.DAMAGED

    def parts_in_words(self) -> Iterator[str]:
        """What of the recording is not in this log, as far as the log says, one sentence each."""
        if self.part_before:
            yield f"goes on from {self.part_before}, which does not lie beside it: its pulses are not in this log"
        if self.part_after:
            yield f"goes on in {self.part_after}, which does not lie beside it: its pulses are not in this log"
        if self.ended_early:
            yield f"ended early: {self.ended_early}"

    def to_json(self) -> dict[str, Any]:
        """The report as one JSON object."""
        return {
            "log": str(self.path),
            "verdict": self.verdict.value,
            "closed": self.closed,
            "being_written": self.being_written,
            "truncated": self.truncated,
            "every_byte_checked": self.every_byte,
            **self.ledger.counts().model_dump(),
            "bytes": self.bytes,
            "missing_pulses": numbers(self.ledger.missing, _PULSES_MAX),
            "incomplete_pulses": self.ledger.incomplete_pulses(_PULSES_MAX),
            "pauses": [wire.to_builtins(pause) for pause in self.ledger.pauses()],
            "ended_early": self.ended_early,
            "part_before": self.part_before,
            "part_after": self.part_after,
            "off_time": list(self.off_time),
            "misfiled": [difference.to_json() for difference in self.recounted.misfiled],
            "findings": list(self.findings),
            "events": [wire.to_builtins(event) for event in self.events],
        }


def verify(path: Path, progress: Callable[[int], None] | None = None) -> VerifyReport:
    """Read and check everything: checksums, indexes, summary, tags against images, pulses without gaps.

    Args:
        path: the log.
        progress: called with the number of bytes read so far.

    Raises:
        BadInputError: no such file, no MCAP log, or not one of ours.
    """
    findings = Findings()
    with LogReader(path) as reader:
        pulses, structure, times = PulseCheck(findings.add), StructureCheck(reader, findings.add), TimeLine()
        for item in reader.items():
            if text := _flaw(item):
                findings.add(text)
            elif isinstance(item, Chunk):
                pulses.take(item)
                times.take(item)
            structure.take(item)
            if progress is not None:
                progress(item.offset + item.length)
        pulses.finish()
        structure.finish()
        apply_extent(reader.metadata, pulses.ledger)
        being_written = not reader.closed and is_being_written(path)
        if unclosed := "" if reader.closed else _STILL_WRITTEN if being_written else _STOPPED_SHORT:
            findings.add(unclosed)
        return VerifyReport(
            path, reader.size, reader.closed, reader.truncated, pulses.ledger,
            pulses.recount.finish(merged=MERGE_METADATA in reader.metadata),
            findings.lines(), tuple(pulses.events), structure.data_checksum and structure.summary_checksum,
            known_lost(reader), ended_early(reader.metadata), missing_before(reader.metadata, path),
            missing_after(reader.metadata, path), being_written, tuple(times.in_words()), unclosed,
        )  # fmt: skip


def _flaw(item: Item) -> str:
    """What is wrong with an item of the log, empty if nothing."""
    match item:
        case Damage(torn=True):
            return f"the last {item.length} bytes, from byte {item.offset} on, are an unfinished record"
        case Damage():
            return f"{item.length} bytes from byte {item.offset} on: {item.text}"
        case Chunk(flaw=flaw) if flaw:
            pulses = sorted({message.sequence for message in item.messages})
            about = f" (pulse {pulses[0]}?)" if pulses else ""
            return f"chunk at byte {item.offset}{about}: {flaw}"
    return ""
