"""Removes what is old from the trash, if the clock can be trusted, and the oldest when the disk's room runs short."""

import threading
import time
from collections.abc import Callable
from typing import Final

from recorder.catalogue.folder import Catalogue
from recorder.catalogue.trash import TrashContents
from rig.api.status import DiskStatus, Status
from rig.clocks import NS_PER_S, UtcAnchor
from rig.errors import StorageError
from rig.events import Event, Level
from rig.host.disk import free_bytes
from rig.host.utc_clock import SetClock, is_synchronized
from rig.phrase import Phrase, phrase
from rig.settings.model import RigSettings
from service.recordings.storage import bytes_per_s, room_for, usable_bytes

#: What was deleted is kept for so long, unless its room is needed.
KEPT_DAYS: Final = 30
_DAY_S: Final = 86400.0
#: What is too old goes one at a time, with so long between: should the clock be wrong after all, people see it in time.
_ONE_EVERY_S: Final = 3600.0
#: Room is made before less than so much can be recorded, or two jumps.
_SPARE_S: Final = 120.0
_SPARE_JUMPS: Final = 2
#: What was deleted a moment ago can be brought back, although room runs short; but not at the cost of a recording.
_FRESH_S: Final = 600.0
#: Between two looks the fastest rigs write some 500 MB, less than the usual reserve.
_LOOK_S: Final = 5.0
_LAST_S: Final = 3 * _LOOK_S
#: A disk that hangs is not waited for longer.
_THREAD_ENDS_S: Final = 2.0
_GB: Final = 1e9


#: Programs that keep a clock right move it by less than 5 ms between two looks (500 ppm, adjtimex(2)); a step is more.
_STEP_NS: Final = NS_PER_S
#: For so long after a step, and after the service has begun to look, nothing is old.
QUIET_S: Final = 3600.0


class SteadyClock:
    """Compares the clock with the time that the computer has been running; one thread asks at intervals.

    Args:
        utc_s: the clock, s.
        running_s: time since the computer was started, s; nobody sets it.
        synchronized: whether some program keeps the clock right.
    """

    def __init__(
        self,
        utc_s: Callable[[], float] = time.time,
        running_s: Callable[[], float] = lambda: time.clock_gettime(time.CLOCK_BOOTTIME),
        synchronized: Callable[[], bool] = is_synchronized,
    ) -> None:
        self._running_s, self._synchronized = running_s, synchronized
        self._set = SetClock(lambda: UtcAnchor(round((utc_s() - running_s()) * NS_PER_S)), _STEP_NS)
        self._since = running_s()

    def trusted(self) -> bool:
        """Whether the clock is kept right, and has not been set for an hour."""
        running = self._running_s()
        if self._set.moved_s():
            self._since = running
        return running - self._since >= QUIET_S and self._synchronized()


class TrashKeeper:
    """Looks after the trash of a folder in a thread of its own, because the disk may hang; a context manager.

    Args:
        in_use: gives the rig in use, which says how much room a recording takes.
        catalogue: of the folder.
        tell: takes an event whenever something was removed, or could not be; any thread may call it.
        clock: whether the clock may say what is too old.
        running_s: a clock that nobody sets, s.
    """

    def __init__(
        self,
        in_use: Callable[[], RigSettings],
        catalogue: Catalogue,
        tell: Callable[[Event], None],
        clock: SteadyClock | None = None,
        running_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._in_use, self._catalogue, self._tell = in_use, catalogue, tell
        self._clock, self._running_s = clock or SteadyClock(), running_s
        self._next_old = running_s()
        self._contents = TrashContents(0, 0)
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="trash keeper", daemon=True)
        self._refused = ""

    def __enter__(self) -> "TrashKeeper":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join(_THREAD_ENDS_S)

    def counted_in(self, status: Status) -> Status:
        """A status whose room counts what the trash holds: it is made free when it is needed."""
        trash, disk = self._contents.bytes, status.disk
        if not trash:
            return status
        room = room_for(self._in_use(), round(disk.free_gb * _GB), trash)
        counted = DiskStatus(
            free_gb=disk.free_gb,
            trash_gb=round(trash / _GB, 2),
            reserve_gb=disk.reserve_gb,
            seconds_left=round(room.seconds),
            jumps_left=room.jumps,
            jump_s=disk.jump_s,
        )
        return status.model_copy(update={"disk": counted})

    def make_room(self, seconds: float, *, spare_fresh: bool = False) -> None:
        """Remove from the trash what must go for a recording of so many seconds, what was deleted first at the front.

        Args:
            seconds: length of the recording.
            spare_fresh: leave what was deleted a moment ago.

        Raises:
            StorageError: the disk refuses.
        """
        free = free_bytes(self._catalogue.directory)
        if free is None:  # the disk is not there
            return
        rig = self._in_use()
        missing = seconds * bytes_per_s(rig) - usable_bytes(rig, free)
        if missing > 0:
            gone = self._catalogue.make_room(missing, older_than_s=_FRESH_S if spare_fresh else 0.0)
            self._say(gone, phrase("why_room_needed", "room was needed"))

    def look(self) -> None:
        """Remove what has been too old for longest, make room if it runs short, and measure what is left.

        Raises:
            StorageError: the disk refuses.
        """
        if self._clock.trusted() and self._running_s() >= self._next_old:
            old = phrase("why_too_old", "it was older than {days} days", days=KEPT_DAYS)
            gone = self._catalogue.purge(older_than_s=KEPT_DAYS * _DAY_S, most=1)
            if gone.recordings:
                self._next_old = self._running_s() + _ONE_EVERY_S
            self._say(gone, old)
        self.make_room(max(_SPARE_S, _SPARE_JUMPS * self._in_use().recorder.jump_s), spare_fresh=True)
        self.make_room(_LAST_S)
        self._contents = self._catalogue.trash()

    def _say(self, gone: TrashContents, why: Phrase) -> None:
        if gone.recordings:
            self._contents = self._catalogue.trash()
            text = "removed from the trash for good: {recordings} recordings, {gb:.1f} GB; {why}"
            said = phrase("event_purged", text, recordings=gone.recordings, gb=gone.bytes / _GB, why=why)
            self._tell(Event.now(Level.INFO, "service", said))

    def _run(self) -> None:
        while not self._over.is_set():
            try:
                self.look()
                self._refused = ""
            except StorageError as error:
                if str(error) != self._refused:
                    self._refused = str(error)
                    self._tell(Event.now(Level.ERROR, "service", error.said))
            self._over.wait(_LOOK_S)
