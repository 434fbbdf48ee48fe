"""The route of server-sent events: the status as it changes, the live log, changes of the list of recordings."""

from collections.abc import AsyncIterator
from typing import Annotated

from fastapi import Header, Query
from fastapi.sse import EventSourceResponse, ServerSentEvent
from starlette.concurrency import run_in_threadpool

from webpanel.routes.common import refusals, strict_router
from webpanel.routes.dependencies import AN_EVENT_STREAM, Service, TheChanges, TheStreams

#: Longest and shortest time between two statuses. The page says "connection lost" after three times the longest.
_STATUS_EVERY_S = 2.0
_STATUS_APART_S = 0.2

router = strict_router("Watching")


@router.get(
    "/events",
    response_class=EventSourceResponse,
    dependencies=[AN_EVENT_STREAM],
    responses=refusals(503),
)
async def watch_events(
    service: Service,
    changes: TheChanges,
    streams: TheStreams,
    after: Annotated[int, Query(ge=0, description="only events with higher numbers", examples=[0])] = 0,
    last_event_id: Annotated[str, Header(max_length=100, include_in_schema=False)] = "",
) -> AsyncIterator[ServerSentEvent]:
    """Watch what happens, as server-sent events; the stream has no end.

    `status`: a Status; at once, then whenever it changes, at most five times a second and at least every 2 s.
    `log`: an Event; first those that are still kept. A browser that connects again goes on where it stopped.
    `recordings`: the list of recordings has changed; fetch it again.
    """
    last_run, _, last_number = last_event_id.partition("-")
    if last_run == changes.run and last_number.isdecimal():
        after = int(last_number[:18])
    seen_recordings = None
    while not streams.events.ending:
        number = changes.number
        status = await changes.status_json(_STATUS_EVERY_S / 2)
        yield ServerSentEvent(event="status", raw_data=status.decode())
        for event in await run_in_threadpool(service.events, after):
            after = event.number
            yield ServerSentEvent(
                event="log", id=f"{changes.run}-{after}", raw_data=event.model_dump_json(ensure_ascii=True)
            )
        if seen_recordings not in {None, changes.recordings}:
            yield ServerSentEvent(event="recordings", raw_data="{}")
        seen_recordings = changes.recordings
        if not await streams.events.ended_within(_STATUS_APART_S):
            await changes.newer_than(number, _STATUS_EVERY_S - 2 * _STATUS_APART_S)
