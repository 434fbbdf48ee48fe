"""The web application of the panel: puts routes, guard, documentation and page together."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import partial
from importlib.metadata import version

from fastapi import FastAPI

from analysis.digitizing.desks import Desks
from analysis.digitizing.files import DeskFiles
from rig.errors import UnknownRecordingError
from service.seam.rig import RigService
from webpanel.documentation import DESCRIPTION, serve_documentation
from webpanel.door.access import Access
from webpanel.door.guard import Guard
from webpanel.door.links import Links
from webpanel.door.logins import Door, Sessions
from webpanel.door.spellings import Spellings
from webpanel.door.streams import OpenStreams
from webpanel.page_files import serve_page
from webpanel.problems import handle_errors
from webpanel.routes.athletes import athletes_router
from webpanel.routes.calibrating import calibrating_router
from webpanel.routes.common import add_routers
from webpanel.routes.contents import contents_router, notes_router, voice_notes_router
from webpanel.routes.digitizing import digitizing_router
from webpanel.routes.events import Changes, events_router
from webpanel.routes.exports import exports_router
from webpanel.routes.files import files_router
from webpanel.routes.links import links_router, visiting
from webpanel.routes.login import login_router
from webpanel.routes.measuring import measuring_router
from webpanel.routes.observing import CountRequests, Metrics, observing_router
from webpanel.routes.preview import cameras_router, close_up_router, preview_router
from webpanel.routes.recordings import recording_router, recordings_router, trash_router
from webpanel.routes.rig import alarms_router, parts_router, rehearsals_router, rig_router, trigger_router
from webpanel.routes.start_list import start_list_router


def create_app(
    service: RigService,
    access: Access,
    links: Links | None = None,
    sessions: Sessions | None = None,
    desks: Desks | None = None,
) -> FastAPI:
    """The panel of one running service.

    Args:
        service: operates the rig.
        access: who may reach the panel.
        links: makes links that open single recordings; None: there are none.
        sessions: of who has logged in; None: they end with the panel.
        desks: where recordings are measured by hand; None: none can be.

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
        redirect_slashes=False, lifespan=lifespan,
    )  # fmt: skip
    app.state.streams = streams
    warn = partial(service.tell, "warning", "access")
    door = Door(access, warn, links, Sessions() if sessions is None else sessions)
    routers = (
        rig_router(service),
        trigger_router(service),
        rehearsals_router(service),
        parts_router(service),
        alarms_router(service),
        recording_router(service),
        recordings_router(service, changes),
        start_list_router(service),
        trash_router(service, changes),
        contents_router(service),
        notes_router(service, changes),
        voice_notes_router(service, changes),
        files_router(service, streams.downloads),
        exports_router(service, streams.downloads),
        measuring_router(service, streams.downloads),
        athletes_router(service),
        digitizing_router(desks or Desks(_nothing_to_measure, lambda: None), streams.events),
        preview_router(service, streams),
        cameras_router(service),
        close_up_router(service, streams),
        calibrating_router(service),
        events_router(service, changes, streams.events),
        login_router(door, service.tell),
        links_router(door, service),
        observing_router(service, metrics),
    )
    routes = add_routers(app, routers)
    handle_errors(app, routes)
    serve_page(app, "/index.html")
    app.add_middleware(
        Guard, door=door, note=lambda said: service.tell("info", "access", said), visit=visiting(service)
    )
    app.add_middleware(Spellings, heads=[route.path_regex for route in routes if "HEAD" in (route.methods or ())])
    app.add_middleware(CountRequests, metrics=metrics)
    serve_documentation(app, access)
    return app


def _nothing_to_measure(recording: str) -> DeskFiles:
    raise UnknownRecordingError(f"recording {recording!r} cannot be measured by hand here")
