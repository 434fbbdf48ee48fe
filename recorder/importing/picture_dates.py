"""When the pictures of a film were taken, as they say themselves. It is told, and is never a rate: cameras round it."""

from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from recorder.importing.tiff_tags import taken_at
from rig.clocks import NS_PER_S, UtcNs
from rig.host.files import read_whole

_MOST_BYTES: Final = 1 << 30
_UNIX: Final = datetime(1970, 1, 1, tzinfo=UTC)


class PictureDates:
    """What the first and the last picture of a film say.

    Args:
        first, last: their files; one and the same, if one file holds all.

    Attributes:
        begin: when the first one was taken, UTC; None: it does not say, or not in which time zone.
        remarks: what they say, in words; nothing if they say nothing.
    """

    def __init__(self, first: Path, last: Path) -> None:
        moments = {path: _moment(path) for path in (first, last)}
        begin, end = moments[first], moments[last]
        self.begin: UtcNs | None = None
        self.remarks: tuple[str, ...] = ()
        if begin is None:
            return
        said = f"its first picture says that it was taken {_words(begin)}"
        if end is not None and last != first:
            said += f", its last one {_words(end)}"
        if begin.tzinfo is None:
            said += ", in a time zone that it does not say: the log's date stays unknown; give --date"
        elif begin > _UNIX:
            self.begin = UtcNs(round((begin - _UNIX).total_seconds() * NS_PER_S))
        self.remarks = (said,)


def _moment(path: Path) -> datetime | None:
    try:
        return taken_at(read_whole(path, _MOST_BYTES, links=True))
    except OSError:  # whoever reads its pixels says so
        return None


def _words(moment: datetime) -> str:
    return moment.isoformat(" ", "milliseconds" if moment.microsecond else "seconds")
