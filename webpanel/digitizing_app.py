"""The web application of `svev digitize`: the page of measuring by hand for one log, without a rig."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from importlib.metadata import version

from fastapi import FastAPI
from fastapi.responses import RedirectResponse
from starlette.datastructures import State

from analysis.digitizing.desks import Desks
from webpanel.door.access import Access
from webpanel.door.guard import Guard
from webpanel.door.logins import Door
from webpanel.door.streams import OpenStreams, Threads
from webpanel.page_files import serve_page
from webpanel.problems import handle_errors
from webpanel.routes import digitizing, login
from webpanel.routes.common import add_routers


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
        lifespan=lifespan,
    )  # fmt: skip

    def unheard(*_: object) -> None:
        """Who measures sees on the page what he did."""

    door = Door(access, unheard)
    app.state = State({"door": door, "desks": desks, "streams": OpenStreams(), "threads": Threads()})
    handle_errors(app, add_routers(app, (digitizing.router, login.router)))
    serve_page(app)
    app.add_middleware(Guard, door=door, visit=unheard)

    @app.get("/", include_in_schema=False)
    def lead() -> RedirectResponse:
        return RedirectResponse(page)

    return app
