"""What the recorder says of a recording and its logs: for the event log, and as reasons why a log ends."""

from pathlib import Path

from rig.errors import StorageError, SvevError
from rig.phrase import Phrase, phrase


def started(recording: str) -> Phrase:
    """A log is open."""
    return phrase("event_started", "recording {recording} started", recording=recording)


def goes_on(before: str, recording: str, failure: SvevError | None) -> Phrase:
    """A recording goes on in another log.

    Args:
        before: id of the log before it.
        recording: id of this log.
        failure: why the one before ended; None: its recorder died.
    """
    if failure is None:
        text = "recording {before} goes on as {recording}: the recorder was started again"
        return phrase("event_goes_on_restarted", text, before=before, recording=recording)
    text = "recording {before} goes on as {recording}: {why}"
    return phrase("event_goes_on", text, before=before, recording=recording, why=failure.said)


def next_part(recording: str, path: Path) -> Phrase:
    """A log is as large as a part may be, and the recording goes on in another one."""
    text = "recording {recording} goes on in its next part {path}"
    return phrase("event_next_part", text, recording=recording, path=str(path))


def no_next_part(path: Path, why: SvevError) -> Phrase:
    """The log of a next part cannot be made."""
    text = "the next part {path} cannot be made: {why}; the recording goes on in the same log"
    return phrase("event_no_next_part", text, path=str(path), why=why.said)


def goes_on_in(path: Path, failure: SvevError) -> Phrase:
    """A log failed, and another one is being made."""
    return phrase("event_goes_on_in", "{why}; the recording goes on in {path}", why=failure.said, path=str(path))


def stopped_at_once(path: Path) -> StorageError:
    """A log was given up, because its recording was to end without delay."""
    text = "{path}: it was stopped without waiting for the disk; what the disk had taken stays readable"
    return StorageError(phrase("why_stopped_at_once", text, path=str(path)))


def not_taken(path: Path, patience_s: float) -> StorageError:
    """The disk has not taken the end of a log in time."""
    text = "{path}: the disk has not taken the rest within {seconds:g} s; look at `dmesg`"
    return StorageError(phrase("why_rest_not_taken", text, path=str(path), seconds=patience_s))


def not_made(folder: Path, patience_s: float) -> StorageError:
    """The disk has not made a file in time."""
    text = (
        "{folder}: the disk does not let a file be made within {seconds:g} s; look at `dmesg`, record to another disk"
    )
    return StorageError(phrase("why_no_file", text, folder=str(folder), seconds=patience_s))


def reserve_reached(path: Path, why: Phrase) -> StorageError:
    """A log ends while there is still room to close it."""
    return StorageError(
        phrase("why_reserve_reached", "{path}: {why}; the log is whole up to there", path=str(path), why=why)
    )
