"""What has changed, for the event streams: carried from the service's threads, with the status made once for all."""

import asyncio
import secrets
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress

from starlette.concurrency import run_in_threadpool

from rig.api.status import Status
from service.seam.rig import RigService


class Changes:
    """Carries "something has changed" from the service's threads to all event streams.

    It also makes the status only once for all of them.

    Attributes:
        number: counts changes of any kind.
        recordings: counts changes of the list of recordings.
        run: begins the ids of events, whose numbers begin anew when the service is restarted.
    """

    def __init__(self, service: RigService) -> None:
        self.number = 0
        self.recordings = 0
        self.run = secrets.token_hex(4)
        self._service = service
        self._loop: asyncio.AbstractEventLoop | None = None
        self._happened = asyncio.Event()
        self._status: tuple[int, float, bytes] | None = None
        self._making = asyncio.Lock()
        self._known: tuple[str | None, str | None] = (None, None)

    @asynccontextmanager
    async def watching(self) -> AsyncIterator[None]:
        """Listen to the service while the context is open."""
        self._loop = asyncio.get_running_loop()
        stop = self._service.listen(lambda: self._tell(self._changed))
        try:
            yield
        finally:
            stop()
            self._loop = None

    def recordings_changed(self) -> None:
        """Tell the streams that a recording was changed, deleted or restored; from any thread."""
        self._tell(self._recordings_changed)

    async def newer_than(self, number: int, timeout_s: float) -> None:
        """Wait until `self.number` is larger than `number`, at most for the given time."""
        if self.number == number:
            with suppress(TimeoutError):
                await asyncio.wait_for(self._happened.wait(), timeout_s)

    async def status_json(self, max_age_s: float) -> bytes:
        """The status as JSON; made anew after a change, or when it is older than `max_age_s`."""
        async with self._making:
            now = asyncio.get_running_loop().time()
            if self._status is None or self._status[0] != self.number or now - self._status[1] > max_age_s:
                number = self.number
                status = await run_in_threadpool(self._service.status)
                self._note_recordings(status)
                self._status = (number, now, status.model_dump_json(ensure_ascii=True).encode())
            return self._status[2]

    def _tell(self, what: Callable[[], None]) -> None:
        if self._loop is not None:
            self._loop.call_soon_threadsafe(what)

    def _recordings_changed(self) -> None:
        self.recordings += 1
        self._changed()

    def _changed(self) -> None:
        self.number += 1
        self._happened.set()
        self._happened = asyncio.Event()

    def _note_recordings(self, status: Status) -> None:
        known = (status.recording.id if status.recording else None, status.last_recording)
        if known != self._known:
            self._known = known
            self.recordings += 1
