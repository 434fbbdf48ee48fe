"""The metadata record of when a recording began and ended: a log may have no pulses for a while before its end.

It also says whether the log ends before its recording was to end, and why.
"""

import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Final

import msgspec

from rig.clocks import NS_PER_S, UtcNs
from rig.phrase import Phrase, plain
from rig.pulse import PulseNumber
from rig.topics import RECORDING_METADATA, RECOVERY_METADATA, RIG_METADATA, SESSION_METADATA, TROUBLE_METADATA
from rig.transport import wire
from triggering.ledger.account import Ledger

#: Field of the record: after so many seconds the recording ended by itself, because nobody had stopped it.
FORGOTTEN: Final = "forgotten_s"
#: Field of the record: why the log ends before the recording was to end.
ENDED_EARLY: Final = "ended_early"
#: Fields of the record: that, and what the disk cost the recording, as phrases in JSON, to be said in other languages.
ENDED_EARLY_SAID: Final = "ended_early_said"
DISK_SAID: Final = "disk_said"
#: Field of the record of a recovery: what is not known of the end of the log that was recovered.
END_UNKNOWN: Final = "end"
#: Fields of the session: id of the log that this one continues, and the number of the last pulse in it.
CONTINUES: Final = "continues"
CONTINUES_AFTER: Final = "continues_after"
#: Field of the session: which part of a split recording this log is; the first one has none.
PART: Final = "part"
#: Field of the record: id of the log in which a split recording goes on.
NEXT_PART: Final = "next_part"


def extent(begin: UtcNs, end: UtcNs) -> dict[str, str]:
    """The fields of the record.

    Args:
        begin: the command to start, UTC; a recording with pre-roll has pulses before it.
        end: the moment from which on pulses no longer belong to the recording, UTC.
    """
    return {"begin_ns": str(begin), "end_ns": str(end)}


def apply_extent(metadata: Mapping[str, Mapping[str, str]], ledger: Ledger) -> None:
    """Tell a ledger what a log's metadata say of its extent; a log that was not closed has no such record.

    Args:
        metadata: fields of the metadata records by name.
        ledger: of the log.
    """
    ledger.follows(last_before(metadata, ledger.first_pulse))
    ledger.lasted(*times_of(metadata), _period_ns(metadata.get(RIG_METADATA, {})))


def times_of(metadata: Mapping[str, Mapping[str, str]]) -> tuple[UtcNs | None, UtcNs | None]:
    """When a recording began and ended, UTC, as its log says; None where it does not."""
    fields = metadata.get(RECORDING_METADATA, {})
    return _time(fields, "begin_ns"), _time(fields, "end_ns")


def forgotten_s(metadata: Mapping[str, Mapping[str, str]]) -> float:
    """After how many seconds a recording that nobody stopped ended by itself; 0: it ended as was wanted.

    Args:
        metadata: fields of the metadata records by name.
    """
    text = metadata.get(RECORDING_METADATA, {}).get(FORGOTTEN, "")
    return float(text) if re.fullmatch(r"\d{1,5}(\.\d{1,3})?", text, re.ASCII) else 0.0


def ended_early(metadata: Mapping[str, Mapping[str, str]]) -> str:
    """Why a log ends before its recording was to end, or that this is not known; empty: it ended as was wanted.

    Args:
        metadata: fields of the metadata records by name.
    """
    told = (
        metadata.get(RECORDING_METADATA, {}).get(ENDED_EARLY, ""),
        metadata.get(RECOVERY_METADATA, {}).get(END_UNKNOWN, ""),
    )
    return "; ".join(text for text in told if text)


def ended_early_said(metadata: Mapping[str, Mapping[str, str]]) -> Phrase:
    """The same with its code and values, where the log has them."""
    return _said(metadata, ENDED_EARLY_SAID, ended_early(metadata))


def disk_trouble(metadata: Mapping[str, Mapping[str, str]]) -> Phrase:
    """What went wrong with the disk while a log was written; empty text: nothing.

    Args:
        metadata: fields of the metadata records by name.
    """
    return _said(metadata, DISK_SAID, "; ".join(metadata.get(TROUBLE_METADATA, {}).values()))


def as_field(said: Phrase) -> str:
    """A phrase as the text of a metadata field."""
    return wire.encode(said).decode()


def part_before(metadata: Mapping[str, Mapping[str, str]], log: Path) -> str:
    """Id of the log that this one continues, if it does not lie beside this one; empty otherwise.

    Args:
        metadata: fields of the metadata records by name.
        log: path of this one.
    """
    return _not_beside(log, metadata.get(SESSION_METADATA, {}).get(CONTINUES, ""))


def part_after(metadata: Mapping[str, Mapping[str, str]], log: Path) -> str:
    """Id of the log in which this one goes on, if it does not lie beside this one; empty otherwise.

    Args:
        metadata: fields of the metadata records by name.
        log: path of this one.
    """
    return _not_beside(log, metadata.get(RECORDING_METADATA, {}).get(NEXT_PART, ""))


def part_number(session: Mapping[str, str]) -> int:
    """Which part of a split recording a log is by the fields of its session; 1: the first one, or there is only one."""
    text = session.get(PART, "")
    return int(text) if session.get(CONTINUES) and re.fullmatch(r"[1-9]\d{0,5}", text, re.ASCII) else 1


def last_before(metadata: Mapping[str, Mapping[str, str]], first: PulseNumber) -> PulseNumber:
    """The last pulse in the log that this one continues; 0: it continues none, or there was no pulse in it.

    Args:
        metadata: fields of the metadata records by name.
        first: first pulse in this log. A part of a split recording that was not closed says nothing else.
    """
    session = metadata.get(SESSION_METADATA, {})
    text = session.get(CONTINUES_AFTER, "")
    if re.fullmatch(r"\d{1,10}", text, re.ASCII):
        return PulseNumber(int(text))
    return PulseNumber(max(0, first - 1) if part_number(session) > 1 else 0)


_PHRASES: Final = wire.decoder(Phrase)
#: Records that may hold one.
_TELLING: Final = (RECORDING_METADATA, RECOVERY_METADATA)
#: No phrase of ours is longer in JSON.
_SAID_MAX: Final = 10_000


def _said(metadata: Mapping[str, Mapping[str, str]], field: str, text: str) -> Phrase:
    """A phrase of the record, if it says what the text beside it says: whoever reads the text is told the same."""
    written = next((metadata[name][field] for name in _TELLING if field in metadata.get(name, {})), "")
    if not 0 < len(written) <= _SAID_MAX:
        return plain(text)
    try:
        said: Phrase = _PHRASES.decode(written.encode())
    except (msgspec.MsgspecError, ValueError, RecursionError):  # of a stranger
        return plain(text)
    return said if said.text == text else plain(text)


def _not_beside(log: Path, other: str) -> str:
    """The id of another log, if that does not lie beside this one; empty otherwise."""
    return "" if not other or os.path.lexists(log.with_name(f"{Path(other).name}{log.suffix}")) else other


def _time(fields: Mapping[str, str], name: str) -> UtcNs | None:
    text = fields.get(name, "")
    return UtcNs(text) if text.isascii() and text.isdecimal() and len(text) <= 20 else None


def _period_ns(fields: Mapping[str, str]) -> float | None:
    """The nominal period by the rig's metadata; None if it is not there or makes no sense."""
    try:
        rate_hz = float(fields.get("rate_hz", ""))
    except ValueError:
        return None
    return NS_PER_S / rate_hz if 1e-6 < rate_hz < 1e6 else None
