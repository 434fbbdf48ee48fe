"""What routes are given: the objects of their application, which stand in its state, and places among long answers."""

from collections.abc import AsyncIterator
from typing import Annotated, Any

from fastapi import Depends, Request

from analysis.digitizing.desks import Desks
from service.seam.rig import RigService
from webpanel.changes import Changes
from webpanel.door.logins import Door
from webpanel.door.streams import OpenStreams, Threads
from webpanel.metrics import Metrics
from webpanel.previews import PreviewFeed, Thumbnails


def _held(name: str) -> Any:
    """An object of the application, by the name under which it stands in `app.state`."""

    async def found(request: Request) -> Any:
        return getattr(request.app.state, name)

    return Depends(found)


def _place(kind: str) -> Any:
    """A place among the open streams of a kind, while the answer lasts.

    Raises:
        ProblemError: 503, the largest number are open.
    """

    async def taken(request: Request) -> AsyncIterator[None]:
        async with getattr(request.app.state.streams, kind).place():
            yield

    return Depends(taken)


Service = Annotated[RigService, _held("service")]
TheDoor = Annotated[Door, _held("door")]
TheDesks = Annotated[Desks, _held("desks")]
TheChanges = Annotated[Changes, _held("changes")]
TheMetrics = Annotated[Metrics, _held("metrics")]
TheFeed = Annotated[PreviewFeed, _held("feed")]
TheThumbnails = Annotated[Thumbnails, _held("thumbnails")]
TheStreams = Annotated[OpenStreams, _held("streams")]
TheThreads = Annotated[Threads, _held("threads")]

AN_EVENT_STREAM, A_PREVIEW, A_PICTURE, A_DOWNLOAD = map(_place, ("events", "previews", "pictures", "downloads"))
