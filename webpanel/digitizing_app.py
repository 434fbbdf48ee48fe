"""The web application of `svev digitize`: the page of measuring by hand for one log, without a rig."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from importlib.metadata import version

from fastapi import FastAPI
from fastapi.responses import RedirectResponse
from fastapi.routing import APIRoute

from analysis.digitizing.desks import Desks
from rig.phrase import Phrase
from webpanel.app import serve_page
from webpanel.door.access import Access
from webpanel.door.guard import Guard
from webpanel.door.logins import Door
from webpanel.door.streams import OpenStreams
from webpanel.problems import handle_errors
from webpanel.routes.common import COMMON
from webpanel.routes.digitizing import digitizing_router


def create_digitizing_app(desks: Desks, access: Access, page: str) -> FastAPI:
    """The page of measuring by hand.

    Args:
        desks: the log that is measured.
        access: who may reach the page: this computer alone, or those with a token.
        page: path that the address without a path leads to.
    """

    @asynccontextmanager
    async def lifespan(_: FastAPI) -> AsyncIterator[None]:
        yield

    app = FastAPI(
        title="Svev: measuring by hand", version=version("svev"), docs_url=None, redoc_url=None, redirect_slashes=False,
        lifespan=lifespan, responses=COMMON, generate_unique_id_function=lambda route: route.name,
    )  # fmt: skip
    app.state.streams = OpenStreams()
    router = digitizing_router(desks)

    app.include_router(router)
    handle_errors(app, [route for route in router.routes if isinstance(route, APIRoute)])

    def unheard(_: Phrase) -> None:
        """Who measures sees on the page what he did."""

    app.add_middleware(Guard, door=Door(access, unheard), note=unheard, visit=lambda _recording, _path: None)

    @app.get("/", include_in_schema=False)
    def lead() -> RedirectResponse:
        return RedirectResponse(page)

    serve_page(app)
    return app
