"""The routes of the page's login: the browser sends the token once, and gets a cookie that scripts cannot read."""

from http import HTTPStatus

from fastapi import Request, Response
from pydantic import Field
from starlette.concurrency import run_in_threadpool

from rig.api.fields import Model
from rig.phrase import phrase
from webpanel.door.logins import COOKIE, SESSION_S, Caller
from webpanel.door.roles import Role
from webpanel.routes.common import NoFields, refusals, strict_router
from webpanel.routes.dependencies import TheDoor


class Login(Model):
    """The token, given once for a session cookie."""

    token: str = Field(max_length=1000, examples=["the content of the token file"])


class OwnAccess(Model):
    """What the caller may do."""

    role: Role = Field(description="each role may do what those before it may")
    logged_in: bool = Field(description="by the session cookie, which `POST /api/logout` ends")


router = strict_router("Login")


@router.post("/login", status_code=HTTPStatus.NO_CONTENT, responses=refusals(413, 415))
async def log_in(door: TheDoor, request: Request, response: Response, login: Login) -> None:
    """Give the token, get a session cookie for 12 hours. Programs send the token with each call instead."""
    client = door.access.client_of(request)
    role = door.check_token(login.token, client)
    if door.access.tokens:
        said = phrase("event_logged_in", "logged in ({caller})", caller=str(Caller(role, client)))
        await run_in_threadpool(door.tell, "info", said)
    response.set_cookie(
        COOKIE, door.sessions.begin(role), max_age=int(SESSION_S), httponly=True, samesite="strict",
        secure=door.access.is_https(request),
    )  # fmt: skip


@router.post("/logout", status_code=HTTPStatus.NO_CONTENT, responses=refusals(413, 415))
async def log_out(door: TheDoor, request: Request, response: Response, _: NoFields = None) -> None:
    """End the session of this cookie."""
    key = request.cookies.get(COOKIE, "")
    role = door.sessions.role_of(key)
    door.sessions.end(key)
    if role is not None and door.access.tokens:
        caller = Caller(role, door.access.client_of(request))
        said = phrase("event_logged_out", "logged out ({caller})", caller=str(caller))
        await run_in_threadpool(door.tell, "info", said)
    response.delete_cookie(COOKIE, httponly=True, samesite="strict", secure=door.access.is_https(request))


@router.get("/access")
async def get_access(door: TheDoor, request: Request) -> OwnAccess:
    """What you may do: `watch`, `operate` or `administer`."""
    caller: Caller = request.state.caller
    logged_in = bool(door.access.tokens) and door.sessions.role_of(request.cookies.get(COOKIE, "")) is not None
    return OwnAccess(role=caller.role, logged_in=logged_in)
