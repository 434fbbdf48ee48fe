"""The route of server-sent events: the status as it changes, the live log, changes of the list of recordings."""

import asyncio
import secrets
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from typing import Annotated

from fastapi import APIRouter, Depends, Header, Query
from fastapi.sse import EventSourceResponse, ServerSentEvent
from starlette.concurrency import run_in_threadpool

from rig.api.status import Status
from service.seam.rig import RigService
from webpanel.door.streams import Streams
from webpanel.routes.common import refusals, strict_router

#: Longest and shortest time between two statuses. The page says "connection lost" after three times the longest.
_STATUS_EVERY_S = 2.0
_STATUS_APART_S = 0.2


class Changes:
    """Carries "something has changed" from the service's threads to all event streams.

    It also makes the status only once for all of them.

    Attributes:
        number: counts changes of any kind.
        recordings: counts changes of the list of recordings.
    """

    def __init__(self, service: RigService) -> None:
        self.number = 0
        self.recordings = 0
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


def events_router(service: RigService, changes: Changes, streams: Streams) -> APIRouter:
    """The route of the event stream."""
    router = strict_router("Watching")
    run = secrets.token_hex(4)  # numbers of events begin anew when the service is restarted

    @router.get(
        "/events",
        response_class=EventSourceResponse,
        dependencies=[Depends(streams.place)],
        responses=refusals(503),
    )
    async def watch_events(
        after: Annotated[int, Query(ge=0, description="only events with higher numbers", examples=[0])] = 0,
        last_event_id: Annotated[str, Header(max_length=100, include_in_schema=False)] = "",
    ) -> AsyncIterator[ServerSentEvent]:
        """Watch what happens, as server-sent events; the stream has no end.

        `status`: a Status; at once, then whenever it changes, at most five times a second and at least every 2 s.
        `log`: an Event; first those that are still kept. A browser that connects again goes on where it stopped.
        `recordings`: the list of recordings has changed; fetch it again.
        """
        last_run, _, last_number = last_event_id.partition("-")
        if last_run == run and last_number.isdecimal():
            after = int(last_number[:18])
        seen_recordings = None
        while not streams.ending:
            number = changes.number
            status = await changes.status_json(_STATUS_EVERY_S / 2)
            yield ServerSentEvent(event="status", raw_data=status.decode())
            for event in await run_in_threadpool(service.events, after):
                after = event.number
                yield ServerSentEvent(
                    event="log", id=f"{run}-{after}", raw_data=event.model_dump_json(ensure_ascii=True)
                )
            if seen_recordings not in {None, changes.recordings}:
                yield ServerSentEvent(event="recordings", raw_data="{}")
            seen_recordings = changes.recordings
            if not await streams.ended_within(_STATUS_APART_S):
                await changes.newer_than(number, _STATUS_EVERY_S - 2 * _STATUS_APART_S)

    return router
