"""Server-sent events: the status as it changes, the live log, and that the list of recordings has changed."""

import secrets
from collections.abc import AsyncIterator
from typing import Annotated

from fastapi import APIRouter, Depends, Header, Query
from fastapi.sse import EventSourceResponse, ServerSentEvent
from starlette.concurrency import run_in_threadpool

from webpanel.api_errors import refusals
from webpanel.changes import Changes
from webpanel.rig_service import RigService
from webpanel.streams import Streams
from webpanel.strict_route import strict_router

#: The page takes three times this as "connection lost".
_STATUS_EVERY_S = 2.0
_STATUS_APART_S = 0.2


def events_router(service: RigService, changes: Changes, streams: Streams) -> APIRouter:
    """The route of the event stream."""
    router = strict_router("Watching")
    run = secrets.token_hex(4)

    async def place() -> AsyncIterator[None]:
        async with streams.place():
            yield

    @router.get("/events", response_class=EventSourceResponse, dependencies=[Depends(place)], responses=refusals(503))
    async def watch_events(
        after: Annotated[int, Query(ge=0, description="only events with higher numbers", examples=[0])] = 0,
        last_event_id: Annotated[str, Header(max_length=100, include_in_schema=False)] = "",
    ) -> AsyncIterator[ServerSentEvent]:
        """Watch what happens, as server-sent events; without end.

        `status`: a Status, at once, then when it changes, at most five times and at least every other second.
        `log`: an Event; first those that are still kept. A browser that connects again goes on where it was.
        `recordings`: the list of recordings has changed; look at it again.
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
