"""What a log is and holds, in a moment: reads tags and events, no pixels."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from recorder.ledger import Ledger
from recorder.log_items import Chunk, Damage
from recorder.log_reader import LogReader, known_lost, tag_of
from recorder.session_changes import session_changes
from rig.topics import RIG_ATTACHMENT, RIG_METADATA, SESSION_METADATA, TAG


@dataclass(frozen=True, slots=True)
class LogInfo:
    """What a log is.

    Attributes:
        closed: the log was closed properly.
        truncated: it ends in the middle of a record.
        damaged_bytes: bytes that could not be read.
        torn_bytes: how many of them are an unfinished record at the end, as every recording that was not closed has.
        ledger: what became of every pulse.
        session, rig: the metadata records, the last of each; the session as it was changed since.
        rig_toml: the rig file as it was when the log was opened, None if it is not there.
        recording: id of the recording, empty if there is no pulse.
        shape: rows and columns of the triplets, None if there is no pulse.
        cameras: names, left to right.
        known_lost: runs of pulses without a tag of which the log itself says that they were lost (`svev recover`).
        messages: number of messages per topic.
        library: who wrote the log.
    """

    path: Path
    bytes: int
    closed: bool
    truncated: bool
    damaged_bytes: int
    torn_bytes: int
    ledger: Ledger
    session: dict[str, str]
    rig: dict[str, str]
    rig_toml: str | None
    recording: str
    shape: tuple[int, int] | None
    cameras: tuple[str, ...]
    known_lost: tuple[tuple[int, int], ...]
    messages: dict[str, int]
    library: str

    @property
    def whole(self) -> bool:
        """Closed, and every byte could be read."""
        return self.closed and not self.damaged_bytes

    def to_json(self) -> dict[str, Any]:
        """The information as one JSON object."""
        ledger = self.ledger
        return {
            "log": str(self.path),
            "closed": self.closed,
            "truncated": self.truncated,
            "damaged_bytes": self.damaged_bytes,
            **ledger.counts(),
            "missing_pulses": sum(last - first + 1 for first, last in ledger.missing),
            "bytes": self.bytes,
            "recording": self.recording,
            "start_ns": None if ledger.first_time is None else str(ledger.first_time),
            "duration_s": round(ledger.duration_s, 6),
            "rate_hz": None if ledger.rate_hz is None else round(ledger.rate_hz, 4),
            "offset_us": ledger.spread_us(),
            "shape": None if self.shape is None else list(self.shape),
            "cameras": list(self.cameras),
            "session": self.session,
            "rig": self.rig,
            "messages": self.messages,
            "library": self.library,
        }


def info(path: Path) -> LogInfo:
    """Read what a log says about itself, and the account of its pulses from its tags.

    The time it takes depends on the number of pulses, not on the size of the log. Nothing is checked (`verify` does).

    Raises:
        BadInputError: no such file, no MCAP log, or not one of ours; or the session changes beside it are broken.
    """
    found = original_info(path)
    return replace(found, session=found.session | session_changes(path))


def original_info(path: Path) -> LogInfo:
    """As `info`, but with the session as the log itself has it.

    Raises:
        BadInputError: no such file, no MCAP log, or not one of ours.
    """
    ledger, first = Ledger(), None
    messages: dict[str, int] = {}
    damaged = torn = 0
    with LogReader(path, skim=True) as reader:
        for item in reader.items(only=(TAG.name,)):
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
        return LogInfo(
            path, reader.size, reader.closed, reader.truncated, damaged, torn, ledger,
            reader.metadata.get(SESSION_METADATA, {}),
            reader.metadata.get(RIG_METADATA, {}),
            _text(reader.attachments.get(RIG_ATTACHMENT)),
            first.recording if first else "",
            first.shape if first else None,
            tuple(camera.name for camera in first.cameras) if first else (),
            known_lost(reader),
            messages, reader.library,
        )  # fmt: skip


def _text(attachment: bytes | None) -> str | None:
    return None if attachment is None else attachment.decode(errors="replace")
