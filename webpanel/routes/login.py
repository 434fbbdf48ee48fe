"""The routes of the page's login: the browser sends the token once, and gets a cookie that scripts cannot read."""

from http import HTTPStatus

from fastapi import APIRouter, Request, Response
from pydantic import Field

from rig.status import Model
from webpanel.door.logins import COOKIE, SESSION_S, Door, client_of
from webpanel.routes.common import NoFields, refusals, strict_router


class Login(Model):
    """The token, given once for a session cookie."""

    token: str = Field(max_length=1000, examples=["the content of the token file"])


def login_router(door: Door) -> APIRouter:
    """The routes that log a browser in and out."""
    router = strict_router("Login")

    @router.post("/login", status_code=HTTPStatus.NO_CONTENT, responses=refusals(413, 415))
    async def log_in(request: Request, response: Response, login: Login) -> None:
        """Give the token, get a session cookie for 12 hours. Programs send the token with each call instead."""
        if door.access.token is not None:
            door.check_token(login.token, client_of(request))
        response.set_cookie(
            COOKIE, door.sessions.begin(), max_age=int(SESSION_S), httponly=True, samesite="strict",
            secure=request.url.scheme == "https",
        )  # fmt: skip

    @router.post("/logout", status_code=HTTPStatus.NO_CONTENT, responses=refusals(413, 415))
    async def log_out(request: Request, response: Response, _: NoFields = None) -> None:
        """End the session of this cookie."""
        door.sessions.end(request.cookies.get(COOKIE, ""))
        response.delete_cookie(COOKIE, httponly=True, samesite="strict", secure=request.url.scheme == "https")

    return router
