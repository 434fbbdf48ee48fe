"""The web application: puts routes, guard and page together."""

import mimetypes
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from importlib.metadata import version
from importlib.resources import files
from typing import Final

from fastapi import FastAPI
from fastapi.routing import APIRoute

from recorder.catalogue import Catalogue
from webpanel.access import Access
from webpanel.api_errors import COMMON
from webpanel.changes import Changes
from webpanel.documentation import DESCRIPTION, serve_documentation
from webpanel.guard import Door, Guard
from webpanel.metrics import CountRequests, Metrics
from webpanel.preview import PreviewFeed
from webpanel.problems import handle_errors
from webpanel.rig_service import RigService
from webpanel.routes_events import events_router
from webpanel.routes_images import images_router
from webpanel.routes_login import login_router
from webpanel.routes_observing import observing_router
from webpanel.routes_preview import preview_router
from webpanel.routes_recordings import recordings_router
from webpanel.routes_rig import rig_router
from webpanel.streams import Streams

_EVENT_STREAMS_MAX = 32
_PREVIEW_STREAMS_MAX = 16
_DOWNLOADS_MAX = 8  # the disk is there for recording first
#: The types of the page's files, whatever the computer's own table says.
_TYPES: Final = {
    ".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml", ".png": "image/png",
    ".json": "application/json", ".webmanifest": "application/manifest+json", ".woff2": "font/woff2",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class OpenStreams:
    """The long answers, by kind; `end` the endless ones before the server shuts down."""

    events: Streams = field(default_factory=lambda: Streams(_EVENT_STREAMS_MAX))
    previews: Streams = field(default_factory=lambda: Streams(_PREVIEW_STREAMS_MAX))
    downloads: Streams = field(default_factory=lambda: Streams(_DOWNLOADS_MAX))

    def end(self) -> None:
        """Have those end that have no end."""
        self.events.end()
        self.previews.end()


def create_app(service: RigService, catalogue: Catalogue, access: Access) -> FastAPI:
    """The panel of one running service.

    Args:
        service: what operates the rig.
        catalogue: its recordings, for reading.
        access: who may reach the panel.

    Returns:
        The application; `app.state.streams` are its `OpenStreams`. Serve it with `webpanel.server.make_server`.
    """
    changes, streams, metrics = Changes(service), OpenStreams(), Metrics(service)

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        async with changes.watching():
            yield

    app = FastAPI(
        title="Svev", version=version("svev"), description=DESCRIPTION, docs_url=None, redoc_url=None,
        redirect_slashes=False, lifespan=lifespan, responses=COMMON,
        generate_unique_id_function=lambda route: route.name,
    )  # fmt: skip
    app.state.streams = streams
    door = Door(access)
    app.add_middleware(Guard, door=door)
    app.add_middleware(CountRequests, metrics=metrics)
    routers = (
        rig_router(service),
        recordings_router(service, catalogue, changes),
        images_router(service, catalogue, streams.downloads),
        preview_router(PreviewFeed(service), streams.previews),
        events_router(service, changes, streams.events),
        login_router(door),
        observing_router(service, metrics),
    )
    for router in routers:
        app.include_router(router)
    handle_errors(app, [route for router in routers for route in router.routes if isinstance(route, APIRoute)])
    serve_documentation(app, access)
    _serve_page(app)
    return app


def _serve_page(app: FastAPI) -> None:
    for suffix, media_type in _TYPES.items():
        mimetypes.add_type(media_type, suffix)
    app.frontend("/", directory=str(files("webpanel") / "page"), fallback=None)
