"""What speaks against the date of this computer's clock: no clock can say of itself that it is wrong.

Files tell of it. What was written cannot be of a later day than today, so that either the clock is wrong now, or it was
wrong then. A clock that nothing keeps right (NTP, PTP) and that stands years after the installation was probably set to
a wrong year, or its battery is empty.
"""

import time
from collections.abc import Iterable
from datetime import datetime, timedelta
from pathlib import Path
from typing import Final

from rig.host.utc_clock import is_synchronized
from rig.phrase import Phrase, phrase

#: What to do about it.
SET_THE_CLOCK: Final = (
    'if today is another day, set it: sudo date -s "YYYY-MM-DD hh:mm", or connect a network; if it is wrong whenever '
    "the power was off, the battery on the mainboard is empty"
)
#: A clock that is earlier than this file is wrong; so is one that stands still without power.
_INSTALLED: Final = Path(__file__)
#: Computers that keep local time may write files with a time that is off by this.
_ZONES_S: Final = timedelta(days=1).total_seconds()
#: Nobody uses a program for so long without installing a newer one, or connecting a network.
_LONG_S: Final = timedelta(days=5 * 365).total_seconds()
#: The last time that has a date here.
_LAST_S: Final = datetime(9999, 1, 1).timestamp()


def clock_doubt(files: Iterable[Path] = ()) -> Phrase | None:
    """What speaks against the clock's date; None: nothing does.

    Args:
        files: that were written before now; those that are not there are left out.
    """
    now_s, installed_s = time.time(), _INSTALLED.stat().st_mtime
    now, installed = f"{_at(now_s):%Y-%m-%d %H:%M}", f"{_at(installed_s):%Y-%m-%d}"
    if now_s < installed_s - _ZONES_S:
        return phrase(
            "check_clock_wrong",
            "the clock says {now}, which is before this program was installed ({installed}): recordings get that date, "
            "and are put in order by it",
            now=now,
            installed=installed,
        )
    written_s, file = max(((_written_s(file), file) for file in files), default=(0.0, Path()))
    if written_s > now_s + _ZONES_S:
        return phrase(
            "check_clock_before",
            "the clock says {now}, and {file} was written on {written}: one of the two dates is wrong",
            now=now,
            file=str(file),
            written=f"{_at(written_s):%Y-%m-%d}",
        )
    if now_s > installed_s + _LONG_S and not is_synchronized():
        return phrase(
            "check_clock_late",
            "the clock says {now}, years after this program was installed ({installed}), and no network keeps it right",
            now=now,
            installed=installed,
        )
    return None


def _at(seconds: float) -> datetime:
    return datetime.fromtimestamp(min(seconds, _LAST_S)).astimezone()


def _written_s(file: Path) -> float:
    """When a file was written, UTC s; 0 where that is not known."""
    try:
        return file.stat().st_mtime
    except OSError:  # it is not there, or no longer
        return 0.0
