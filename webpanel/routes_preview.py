"""Live pictures of the rig."""

import asyncio
from collections.abc import AsyncIterator
from http import HTTPStatus

from fastapi import APIRouter, Depends, Response
from fastapi.responses import StreamingResponse

from webpanel.api_errors import Responses, jpeg_answer, refusals
from webpanel.preview import Picture, PreviewFeed
from webpanel.problems import ProblemError
from webpanel.streams import Streams
from webpanel.strict_route import strict_router

_BOUNDARY = "svev-triplet"
#: A stream ends when so many seconds brought no picture; the page asks again.
_PATIENCE_S = 30


def preview_router(feed: PreviewFeed, streams: Streams) -> APIRouter:
    """The routes of the preview."""
    router = strict_router("Watching")

    async def place() -> AsyncIterator[None]:
        async with streams.place():
            yield

    @router.get("/preview.jpg", response_class=Response, responses=jpeg_answer("The triplet.") | refusals(404))
    async def get_preview() -> Response:
        """The newest triplet, the cameras side by side. The headers say which pulse it is."""
        picture = await feed.other_than(None)
        if picture is None:
            text = "no triplet has come: arm the rig, and see that pulses arrive"
            raise ProblemError(HTTPStatus.NOT_FOUND, "no_preview", text)
        return Response(picture.jpeg, media_type="image/jpeg", headers=_facts(picture))

    @router.get(
        "/preview.mjpg",
        response_class=StreamingResponse,
        dependencies=[Depends(place)],
        responses=_STREAM | refusals(503),
    )
    async def watch_preview() -> StreamingResponse:
        """The newest triplets, at most ten a second, as a stream that an `<img>` shows. Ends after 30 s without any."""
        return StreamingResponse(_parts(feed, streams), media_type=f"multipart/x-mixed-replace; boundary={_BOUNDARY}")

    return router


_CONTENT = {"multipart/x-mixed-replace": {"schema": {"type": "string", "format": "binary"}}}
_STREAM: Responses = {200: {"description": "Pictures, one after the other.", "content": _CONTENT}}


async def _parts(feed: PreviewFeed, streams: Streams) -> AsyncIterator[bytes]:
    loop = asyncio.get_running_loop()
    seen, seen_at = None, loop.time()
    # A browser shows a picture when the boundary behind it has come: so each part ends in one.
    yield f"--{_BOUNDARY}\r\n".encode()
    while not streams.ending and loop.time() - seen_at < _PATIENCE_S:
        picture = await feed.other_than(seen)
        if picture is not None and picture.pulse != seen:
            seen, seen_at = picture.pulse, loop.time()
            yield _part(picture)


def _part(picture: Picture) -> bytes:
    head = {"Content-Type": "image/jpeg", "Content-Length": str(len(picture.jpeg))} | _facts(picture)
    lines = "".join(f"{name}: {value}\r\n" for name, value in head.items())
    return lines.encode() + b"\r\n" + picture.jpeg + f"\r\n--{_BOUNDARY}\r\n".encode()


def _facts(picture: Picture) -> dict[str, str]:
    return {"X-Svev-Pulse": str(picture.pulse), "X-Svev-Statuses": picture.statuses}
