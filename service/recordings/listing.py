"""What a list says of a recording beside its log's own account."""

from collections.abc import Mapping
from datetime import UTC, datetime, timedelta
from itertools import islice
from typing import Final

from recorder.log.extent import CONTINUES, CONTINUES_AFTER, PART
from rig.api.fields import LONGEST_LINE
from rig.api.recordings import SessionFields
from rig.api.start_list import COLUMN_NAME_MAX, COLUMNS_MAX
from rig.clocks import UtcNs
from service.recordings.notes import NOTE_FIELD

_EPOCH: Final = datetime(1970, 1, 1, tzinfo=UTC)
#: Session fields of which the program itself makes something.
_PROGRAMS: Final = frozenset(
    {*SessionFields.model_fields, "recording", "session", "tags", "favourite", CONTINUES, CONTINUES_AFTER, PART}
)
#: What the start list says of a jumper beside the own columns.
_BESIDE_COLUMNS: Final = ("round", "club")


def more_of(session: Mapping[str, str]) -> dict[str, str]:
    """What the start list had of the jumper: the fields of a session that are none of the program's own.

    No more and no longer than a start list can have: a log that somebody else has made may hold anything.
    """
    own = (
        (name, text[:LONGEST_LINE])
        for name, text in session.items()
        if name not in _PROGRAMS and not name.startswith(NOTE_FIELD) and len(name) <= COLUMN_NAME_MAX and text
    )
    return dict(islice(own, COLUMNS_MAX + len(_BESIDE_COLUMNS)))


def utc(time: UtcNs) -> datetime:
    """A time as the API gives it: to the microsecond before it, so that a query for recordings since then finds it."""
    return _EPOCH + timedelta(microseconds=time // 1000)
