"""The web application of the panel: puts routes, guard, documentation and page together."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import partial
from importlib.metadata import version
from typing import Final, Literal

from fastapi import FastAPI
from starlette.datastructures import State

from analysis.digitizing.desks import Desks
from analysis.digitizing.files import DeskFiles
from rig.errors import UnknownRecordingError
from rig.phrase import Phrase
from service.seam.rig import RigService
from webpanel.changes import Changes
from webpanel.documentation import DESCRIPTION, serve_documentation
from webpanel.door.access import Access
from webpanel.door.guard import Guard
from webpanel.door.links import Links
from webpanel.door.logins import Door, Sessions
from webpanel.door.spellings import Spellings
from webpanel.door.streams import OpenStreams, Threads
from webpanel.metrics import CountRequests, Metrics
from webpanel.page_files import serve_page
from webpanel.previews import PreviewFeed, Thumbnails
from webpanel.problems import handle_errors
from webpanel.routes import (
    athletes,
    calibrating,
    contents,
    digitizing,
    events,
    exports,
    files,
    links,
    login,
    measuring,
    observing,
    preview,
    recordings,
    rig,
    start_list,
)
from webpanel.routes.common import add_routers

_ROUTES: Final = (
    rig, recordings, start_list, contents, files, exports, measuring, athletes, digitizing, preview, calibrating,
    events, login, links, observing,
)  # fmt: skip


def create_app(
    service: RigService,
    access: Access,
    open_links: Links | None = None,
    sessions: Sessions | None = None,
    desks: Desks | None = None,
) -> FastAPI:
    """The panel of one running service.

    Args:
        service: operates the rig.
        access: who may reach the panel.
        open_links: makes links that open single recordings; None: there are none.
        sessions: of who has logged in; None: they end with the panel.
        desks: where recordings are measured by hand; None: none can be.

    Returns:
        The application; `app.state.streams` are its `OpenStreams`. Serve it with `webpanel.server.make_server`.
    """
    given = _given(service, access, open_links, sessions, desks)

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        async with given.changes.watching():
            yield

    app = FastAPI(
        title="Svev", version=version("svev"), description=DESCRIPTION, docs_url=None, redoc_url=None,
        redirect_slashes=False, lifespan=lifespan,
    )  # fmt: skip
    app.state = given
    routes = add_routers(app, (of.router for of in _ROUTES))
    handle_errors(app, routes)
    serve_page(app, "/index.html")
    app.add_middleware(Guard, door=given.door, visit=partial(links.check_visit, service))
    app.add_middleware(Spellings, heads=[route.path_regex for route in routes if "HEAD" in (route.methods or ())])
    app.add_middleware(CountRequests, metrics=given.metrics)
    serve_documentation(app, access)
    return app


def _given(
    service: RigService, access: Access, open_links: Links | None, sessions: Sessions | None, desks: Desks | None
) -> State:
    """What routes are given, by the names in `webpanel.routes.dependencies`."""
    streams = OpenStreams()
    return State(
        {
            "service": service,
            "door": Door(access, partial(_tell, service), open_links, Sessions() if sessions is None else sessions),
            "desks": desks or Desks(_nothing_to_measure, lambda: None),
            "changes": Changes(service),
            "metrics": Metrics(service),
            "feed": PreviewFeed(service, streams),
            "thumbnails": Thumbnails(),
            "streams": streams,
            "threads": Threads(),
        }
    )


def _tell(service: RigService, level: Literal["info", "warning"], said: Phrase) -> None:
    service.tell(level, "access", said)


def _nothing_to_measure(recording: str) -> DeskFiles:
    raise UnknownRecordingError(f"recording {recording!r} cannot be measured by hand here")
