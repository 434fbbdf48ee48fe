"""Makes one log of two that two computers recorded of the same pulses, with the cameras of both.

Both logs are read twice: their tags, to find which pulses are the same (`triggering.alignment`); then everything, pulse
by pulse, which the recorder's own writer puts into a new log. Memory grows with the number of pulses, not with the size
of the logs. The new log is there under its name only when it is complete.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import groupby
from pathlib import Path

from recorder.log.extent import CONTINUES, CONTINUES_AFTER, extent
from recorder.merging.calibration_file import Attached, joined_calibration
from recorder.merging.joined import JoinedTriplets, check_fit
from recorder.merging.rig_file import joined_rig_toml
from recorder.merging.source import LogStream, Note, Part, look_at
from recorder.reading.info import merged_in_words
from recorder.reading.items import Message
from recorder.reading.triplets import event_of
from recorder.recovering.rebuilt_log import RebuiltLog
from recorder.recovering.unfinished_log import check_target, unfinished_log
from recorder.writing.log_writer import LogDescription
from rig.clocks import UtcNs
from rig.errors import BadInputError, LogDamagedError
from rig.events import Event, Level
from rig.phrase import escaped, plain
from rig.topics import (
    CALIBRATION_ATTACHMENT,
    EVENTS,
    MERGE_METADATA,
    RECORDING_METADATA,
    RIG_ATTACHMENT,
    TAG,
    TROUBLE_METADATA,
)
from triggering.alignment import Alignment, align
from triggering.ledger.account import Ledger, span


@dataclass(frozen=True, slots=True)
class MergeReport:
    """What was merged.

    Attributes:
        sources: the logs that were read.
        path: the log that was written.
        bytes: its size.
        ledger: what became of every pulse, as the new log has it.
        alignment: how the second log was put on the line of time of the first.
        alone: pulses that only the first, and only the second log has.
    """

    sources: tuple[Path, Path]
    path: Path
    bytes: int
    ledger: Ledger
    alignment: Alignment
    alone: tuple[int, int]

    def to_json(self) -> dict[str, object]:
        """The report as one JSON object."""
        return {
            "sources": [str(source) for source in self.sources],
            "log": str(self.path),
            "bytes": self.bytes,
            **self.ledger.counts().model_dump(),
            "common": self.alignment.common,
            "alone": list(self.alone),
            "offset_ms": round(self.alignment.offset_ns / 1e6, 6),
            "offset_sigma_us": round(self.alignment.sigma_ns / 1e3, 3),
            "drift_ppm": round(self.alignment.drift_ppm, 4),
            "residual_us": round(self.alignment.residual_ns / 1e3, 3),
        }


def merge(first: Path, second: Path, target: Path, progress: Callable[[int], None] | None = None) -> MergeReport:
    """Write the pulses of both logs into a new one.

    Args:
        first: its line of time is that of the new log; its cameras stand on the left.
        second: the other log.
        target: must not exist.
        progress: called with the number of pulses that are done, those of both logs together.

    Raises:
        BadInputError: no such file, no log of svev, the target exists or cannot be made, the cameras do not fit
            together, or it cannot be decided which pulses are the same.
        LogDamagedError: a log was not closed or is damaged.
        StorageError: the disk refuses; nothing of the new log is left.
    """
    check_target(target)
    parts = look_at(first), look_at(second)
    check_fit(*parts)
    try:
        alignment = align(parts[0].train, parts[1].train)
    except BadInputError as error:
        raise BadInputError(f"{first} and {second}: {error}") from None
    with unfinished_log(target) as unfinished, LogStream(first) as one, LogStream(second) as two:
        merging = _Merging(parts, (one, two), alignment, escaped(target.stem))
        size = merging.write(unfinished, progress or (lambda _: None))
    alone = [int(sum(alignment.pairs[:, 1 - side] < 0)) for side in (0, 1)]
    return MergeReport((first, second), target, size, merging.ledger, alignment, (alone[0], alone[1]))


class _Merging:
    """Writes the new log.

    Attributes:
        ledger: the pulses that have been written.
    """

    def __init__(
        self, parts: tuple[Part, Part], streams: tuple[LogStream, LogStream], alignment: Alignment, recording: str
    ) -> None:
        self._parts, self._streams, self._alignment, self._recording = parts, streams, alignment, recording
        self._joined = JoinedTriplets(*parts, alignment, recording)
        self.ledger = Ledger()

    def write(self, path: Path, progress: Callable[[int], None]) -> int:
        """Write the log; returns its size."""
        joined = self._joined
        own_topics = joined.cameras if all(part.own_topics for part in self._parts) else ()
        with RebuiltLog(path, self._description(), joined.shape, own_topics, joined.kind) as log:
            notes = [lambda note, side=side: self._note(log, note, side) for side in (0, 1)]
            done = 0
            for number, pair in enumerate(self._alignment.pairs, 1):
                one, two = (
                    None if place < 0 else stream.take(int(part.train.times[place]), note)
                    for place, part, stream, note in zip(pair, self._parts, self._streams, notes, strict=True)
                )
                tag = joined.tag(number, one, two)
                self.ledger.add(tag)
                ready = Message(TAG.name, 0, number, joined.ready(one, two), tag.time, 0, 0, 0, None)
                try:
                    log.pulse(tag, joined.picture(one, two), ready)
                except ValueError as error:
                    raise BadInputError(f"pulse {number} cannot be written ({error})") from None
                done += 2 - int(sum(pair < 0))
                progress(done)
            for stream, note in zip(self._streams, notes, strict=True):
                stream.finish(note)
            for event in self._absences():
                log.other(EVENTS.name, event.to_protobuf(), event.time, event.time)
            return log.close(self._metadata(), self._event())

    def _note(self, log: RebuiltLog, note: Note, side: int) -> None:
        """Write an event or a health record; those of the second log on the line of time of the first."""
        if side == 0:
            log.other(note.topic, note.data, note.publish_time, note.log_time)
            return
        publish, ready = (UtcNs(self._alignment.mapped(time)) for time in (note.publish_time, note.log_time))
        data = note.data
        if note.topic == EVENTS.name:
            message = Message(note.topic, 0, 0, note.log_time, note.publish_time, 0, 0, 0, memoryview(data))
            event = event_of(message)
            if event is None:
                raise LogDamagedError(f"{self._parts[1].path}: an event cannot be read; look at `svev verify`")
            data = Event(publish, event.level, event.name, event.message).to_protobuf()
        log.other(note.topic, data, publish, ready)

    def _absences(self) -> Iterator[Event]:
        """An event for each camera where its log knows nothing of pulses between its first and its last one.

        It says why the camera is absent there, though its frame numbers go on.
        """
        pairs, times = self._alignment.pairs, [part.train.times for part in self._parts]
        for side, part in enumerate(self._parts):
            there = (pairs[:, side] >= 0).nonzero()[0]
            numbers = [number for number in range(there[0], there[-1]) if pairs[number, side] < 0]
            for _, run in groupby(enumerate(numbers), lambda each: each[1] - each[0]):
                missing = [number for _, number in run]
                time = int(times[1 - side][pairs[missing[0], 1 - side]])
                at = UtcNs(self._alignment.mapped(time) if side == 0 else time)
                pulses = span(missing[0] + 1, missing[-1] + 1)
                for camera in part.first.cameras:
                    yield Event(at, Level.WARNING, camera.name, f"absent: its log knows nothing of {pulses}")

    def _description(self) -> LogDescription:
        one, two = self._parts
        streams = self._streams
        session = {**two.about.session, **one.about.session, "recording": self._recording}
        for key in (CONTINUES, CONTINUES_AFTER):
            session.pop(key, None)
        rigs = [part.about.rig for part in self._parts]
        names = ", ".join(name for name, _ in self._joined.cameras)
        name = " + ".join(rig["name"] for rig in rigs if rig.get("name"))
        calibrations = [
            Attached(
                part.path.name,
                [camera.name for camera in part.first.cameras],
                stream.attachments.get(CALIBRATION_ATTACHMENT),
            )
            for part, stream in zip(self._parts, streams, strict=True)
        ]
        return LogDescription(
            session=session,
            rig={**rigs[0], "name": name, "cameras": names},
            rig_toml=joined_rig_toml(*(stream.attachments.get(RIG_ATTACHMENT, b"") for stream in streams)),
            calibration_json=joined_calibration(calibrations),
            calibrations={**streams[1].calibrations, **streams[0].calibrations},
            begin=self._parts[0].first.time,
        )

    def _metadata(self) -> dict[str, dict[str, str]]:
        one, two = self._parts
        mapped = self._alignment.mapped
        begins = [time for time in (one.begin, two.begin and mapped(two.begin)) if time]
        ends = [time for time in (one.end, two.end and mapped(two.end)) if time]
        found = {MERGE_METADATA: self._provenance()}
        if begins and ends:
            found[RECORDING_METADATA] = extent(UtcNs(min(begins)), UtcNs(max(ends)))
        troubles = [part.metadata.get(TROUBLE_METADATA, {}).values() for part in self._parts]
        if any(troubles):
            found[TROUBLE_METADATA] = {"disk": "; ".join(text for trouble in troubles for text in trouble)}
        return found

    def _provenance(self) -> dict[str, str]:
        alignment, fields = self._alignment, {"time": datetime.now(UTC).isoformat(timespec="seconds")}
        for place, part in enumerate(self._parts, 1):
            known = part.train.error_ns
            fields |= {
                f"source_{place}": part.path.name,
                f"recording_{place}": part.first.recording,
                f"cameras_{place}": ", ".join(camera.name for camera in part.first.cameras),
                f"pulses_{place}": str(len(part.train.times)),
                f"utc_at_most_us_{place}": "" if known is None else f"{known / 1e3:.3f}",
            }
        return fields | {
            "common": str(alignment.common),
            "offset_ms": f"{alignment.offset_ns / 1e6:.6f}",
            "offset_sigma_us": f"{alignment.sigma_ns / 1e3:.3f}",
            "drift_ppm": f"{alignment.drift_ppm:.4f}",
            "residual_us": f"{alignment.residual_ns / 1e3:.3f}",
        }

    def _event(self) -> Event:
        return Event.now(Level.INFO, "merge", plain(merged_in_words(self._provenance())))
