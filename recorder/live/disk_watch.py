"""Watches whether the disk keeps up with a recording: is it behind, does it hang, how many frames does that cost."""

from collections.abc import Iterator
from pathlib import Path
from typing import Final

from recorder.writing.log_writer import LogWriter
from rig.clocks import NS_PER_S, HostNs
from rig.errors import StorageError
from rig.events import Event, Level
from rig.phrase import Phrase, phrase

#: A disk that has finished nothing for so long hangs: much longer than any disk's housekeeping takes.
_HANGS_S: Final = 2.0
#: A log whose disk has taken nothing for so long is given up, s.
_HUNG_S: Final = 30.0
#: The same if there is another disk: before the frames no longer fit into memory.
_HUNG_WITH_OTHER_DISK_S: Final = 2 * _HANGS_S
#: Frames may wait for the disk for so long before people are told.
_BEHIND_NS: Final = NS_PER_S
_MB: Final = 1e6


class DiskWatch:
    """Looks several times a second at one log and at the frames that wait for it.

    Args:
        wanted_bytes_per_s: what the cameras make.
        underruns: frames that have found no free slot in their camera's ring so far.

    Attributes:
        lost: frames lost because everything that could hold them waited for the disk.
    """

    def __init__(self, wanted_bytes_per_s: float, underruns: int) -> None:
        self._wanted, self._underruns = wanted_bytes_per_s, underruns
        self.lost = 0
        self._behind_since: tuple[HostNs, int] | None = None
        self._rate: float | None = None
        self._told_behind = self._told_lost = self._hanging = False
        self._hung_s = 0.0

    def look(self, now: HostNs, log: LogWriter, *, behind: bool, underruns: int) -> Iterator[Event]:
        """Take note of the present state.

        Args:
            now: present time.
            log: the log.
            behind: whether frames wait for a free triplet buffer.
            underruns: as in the constructor.

        Yields:
            What people should know.
        """
        yield from self._look_for_hanging(log.stalled_s())
        written = log.statistics().bytes_written
        was_behind = self._behind_since is not None
        if behind and self._behind_since is None:
            self._behind_since = now, written
        if self._behind_since is not None and now > self._behind_since[0]:
            since, before = self._behind_since
            self._rate = (written - before) / ((now - since) / NS_PER_S)
            if now - since > _BEHIND_NS and not self._told_behind and not self._hanging:
                self._told_behind = True
                said = phrase("event_disk_behind", "the disk falls behind: it takes {rates}", rates=self._rates())
                yield Event.now(Level.WARNING, "disk", said)
        new, self._underruns = underruns - self._underruns, underruns
        if new > 0 and (behind or was_behind):
            self.lost += new
            if not self._told_lost:
                self._told_lost = True
                said = phrase("event_disk_lost", "{cause}: frames are lost; " + _REMEDY, cause=self._cause())
                yield Event.now(Level.ERROR, "disk", said)
        if not behind:
            self._behind_since = None

    def trouble(self, lost: int) -> Phrase | None:
        """What the disk cost the recording, in one line; None: nothing.

        Args:
            lost: frames of the recording that are lost, for whatever reason. Those that overflowed are more if pulses
                came on after its end.
        """
        lost = min(lost, self.lost)
        if not lost:
            return None
        return phrase("disk_cost", "{cause}: {lost} frames were lost; " + _REMEDY, cause=self._cause(), lost=lost)

    def _look_for_hanging(self, stalled_s: float) -> Iterator[Event]:
        if stalled_s >= _HANGS_S:
            self._hung_s = max(self._hung_s, stalled_s)
            if not self._hanging:
                text = "the disk hangs: it has taken nothing for {seconds:g} s; look at `dmesg`"
                yield Event.now(Level.ERROR, "disk", phrase("event_disk_hangs", text, seconds=_HANGS_S))
        elif self._hanging:
            text = "the disk takes data again, after {seconds:.0f} s"
            yield Event.now(Level.WARNING, "disk", phrase("event_disk_again", text, seconds=self._hung_s))
        self._hanging = stalled_s >= _HANGS_S

    def _cause(self) -> Phrase:
        if self._hung_s:
            return phrase("why_disk_hung", "the disk hung for {seconds:.0f} s", seconds=self._hung_s)
        return phrase("why_disk_slow", "disk too slow: it took {rates}", rates=self._rates())

    def _rates(self) -> Phrase:
        wanted = self._wanted / _MB
        if self._rate is None:
            return phrase("disk_rate_few", "few MB/s, the cameras make {wanted:.1f} MB/s", wanted=wanted)
        text = "{taken:.1f} MB/s, the cameras make {wanted:.1f} MB/s"
        return phrase("disk_rates", text, taken=self._rate / _MB, wanted=wanted)


_REMEDY: Final = "record to a faster disk, and let nothing else use it"


def hung(path: Path, log: LogWriter, *, other_disk: bool) -> StorageError | None:
    """Why a log is given up whose disk has taken nothing for long; None if it has.

    Args:
        path: the log's.
        log: the log.
        other_disk: whether the recording can go on there.
    """
    stalled = log.stalled_s()
    if stalled <= (_HUNG_WITH_OTHER_DISK_S if other_disk else _HUNG_S):
        return None
    text = "{path}: the disk has taken nothing for {seconds:.0f} s; look at `dmesg`, record to another disk"
    return StorageError(phrase("why_disk_takes_nothing", text, path=str(path), seconds=stalled))


def too_full(log: LogWriter, reserve_gb: float) -> Phrase | None:
    """Why a recording ends while there is still room to close its log; None if there is more."""
    free = log.free_bytes
    if free is None or free >= reserve_gb * 1e9:
        return None
    text = "only {free_gb:.1f} GB are free and {reserve_gb:g} GB are kept in reserve: recording stopped; make room"
    return phrase("why_disk_reserve", text, free_gb=free / 1e9, reserve_gb=reserve_gb)
