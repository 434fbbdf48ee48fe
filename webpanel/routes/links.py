"""Routes of the link that opens one recording on an athlete's phone: its QR code, and what the phone sends back."""

from datetime import UTC, datetime
from http import HTTPStatus
from ipaddress import ip_address
from typing import Annotated, Final
from urllib.parse import quote

import cv2
import numpy as np
from fastapi import Path, Request, Response
from pydantic import Field

from rig.api.fields import Model
from rig.errors import UnknownRecordingError
from rig.host.file_names import ID_PATTERN
from service.seam.rig import RigService
from webpanel.door.access import Access, is_loopback
from webpanel.door.links import KEY_LENGTH
from webpanel.door.logins import LINK_COOKIE
from webpanel.problems import ProblemError
from webpanel.routes.common import CHANGING, RecordingId, refusals, strict_router
from webpanel.routes.dependencies import Service, TheDoor

#: What JavaScript's encodeURIComponent leaves as it is, and `quote` does not: the page and the cookie write ids alike.
_UNQUOTED: Final = "!'()"
#: So soon a phone may ask again for what it cannot have while a recording runs, s.
_AGAIN_S: Final = 3
#: Empty modules around a code (ISO/IEC 18004, 5.3.8: four).
_QR_MARGIN: Final = 4


class JumpLink(Model):
    """A link that opens one recording without a token."""

    link: str = Field(description="address to open on a phone")
    ends: datetime = Field(description="when it ends, UTC")
    code: str = Field(description="the address as a QR code, SVG")


class OpenLink(Model):
    """A link that opens a recording; its key is shown to nobody again."""

    number: int = Field(description="which link of the recording it is")
    made: datetime = Field(description="when its code was shown first, UTC")
    ends: datetime = Field(description="when it ends, UTC")


class LinkLogin(Model):
    """What the link to a recording holds."""

    recording: str = Field(pattern=f"^{ID_PATTERN}$", description="id of the recording", examples=["20260214-101530"])
    key: str = Field(min_length=KEY_LENGTH, max_length=KEY_LENGTH, examples=["AcJp5q0mXb1c2d3e4f5g6h7i8j9"])


class Visit(Model):
    """What a link opens."""

    recording: str = Field(description="id of the recording")
    ends: datetime = Field(description="when the link ends, UTC")


router = strict_router("Login")


@router.get("/recordings/{recording_id}/link", responses=refusals(404, 409))
def get_link(service: Service, door: TheDoor, recording_id: RecordingId, request: Request) -> JumpLink:
    """A link that opens this recording, and nothing else, on a phone without a token, and its QR code.

    It shows the page of the jump with its pictures, figures and files, not the log and the notes, until `ends`
    (`service.share_hours` of the rig file), while the recording is not in the trash, and while the tokens of the
    service are the same. 409 if phones cannot reach the service.
    """
    if service.recording(recording_id).deleted:
        text = "the jump lies in the trash: restore it, then show its code"
        raise ProblemError(HTTPStatus.CONFLICT, "deleted_jump", text)
    address = address_for_phones(request, door.access)
    if door.links is None or address is None:
        text = (
            "phones cannot reach this service, so that a code would open nothing: start it with --host, a token "
            "and --allow-host, and open this page by the address that phones use"
        )
        raise ProblemError(HTTPStatus.CONFLICT, "no_phones", text)
    key, ends = door.links.make(recording_id)
    link = f"{address}/#/jump/{quote(recording_id, safe=_UNQUOTED)}/{key}"
    return JumpLink(link=link, ends=_utc(ends), code=qr_svg(link))


@router.get("/recordings/{recording_id}/links", responses=refusals(404))
def list_links(service: Service, door: TheDoor, recording_id: RecordingId) -> list[OpenLink]:
    """The links that open this recording, the oldest first. A code that is shown again soon is the same link."""
    service.recording(recording_id)
    found = [] if door.links is None else door.links.open_links(recording_id)
    return [OpenLink(number=each.minute, made=_utc(each.made), ends=_utc(60.0 * each.minute)) for each in found]


@router.delete(
    "/recordings/{recording_id}/links/{number}",
    status_code=HTTPStatus.NO_CONTENT,
    responses=CHANGING | refusals(404, 503),
)
def take_link_back(
    service: Service,
    door: TheDoor,
    recording_id: RecordingId,
    number: Annotated[int, Path(ge=0, lt=1 << 32, description="`number` of the link")],
) -> None:
    """Let a link open nothing any more, also where it is open now. The next code of the recording is another one.

    503: it is taken back, but the disk refuses to keep that, so that a restart of the service would open it again.
    """
    service.recording(recording_id)
    kept = None if door.links is None else door.links.take_back(recording_id, number)
    if kept is None:
        text = "there is no such link, or it opens nothing any more: look at the list again"
        raise ProblemError(HTTPStatus.NOT_FOUND, "unknown_link", text)
    if not kept:
        text = "the link is taken back until the service is restarted, no longer: its disk refuses; make room on it"
        raise ProblemError(HTTPStatus.SERVICE_UNAVAILABLE, "link_not_kept", text)


@router.post("/login/link", responses=refusals(413, 415))
def log_in_by_link(door: TheDoor, request: Request, response: Response, given: LinkLogin) -> Visit:
    """Give the key of a link, get a cookie that opens the recording of the link until it ends."""
    ends, left_s = door.check_link(given.recording, given.key)
    response.set_cookie(
        LINK_COOKIE, given.key, max_age=int(left_s), httponly=True, samesite="strict",
        path=f"/api/recordings/{quote(given.recording, safe=_UNQUOTED)}", secure=door.access.is_https(request),
    )  # fmt: skip
    return Visit(recording=given.recording, ends=_utc(ends))


def _utc(time_s: float) -> datetime:
    return datetime.fromtimestamp(time_s, UTC)


def check_visit(service: RigService, recording: str, path: str) -> None:
    """Check a call of somebody who has a link to a recording.

    A recording in the trash is shown to nobody; and the phones of a whole team read nothing large from the disk while
    a recording runs, which comes first.

    Raises:
        ProblemError: 404 it lies in the trash, 503 a recording runs.
    """
    try:
        deleted = service.recording(recording).deleted
    except UnknownRecordingError:
        deleted = True
    if deleted:
        raise ProblemError(HTTPStatus.NOT_FOUND, "unknown_recording", "this jump was deleted: ask the coach")
    own = f"/api/recordings/{recording}"
    if path not in {own, f"{own}/measurement"} and service.status().recording is not None:
        text = "pictures and files wait while a recording runs: they come when it has ended"
        raise ProblemError(HTTPStatus.SERVICE_UNAVAILABLE, "recording_runs", text, {"Retry-After": str(_AGAIN_S)})


def address_for_phones(request: Request, access: Access) -> str | None:
    """Scheme, name and port by which phones reach the service, None: they cannot.

    That is how whoever asks has reached it; or, if he sits at this computer, a name that the service was told.
    """
    if not access.tokens:
        return None
    scheme = "https" if access.is_https(request) else "http"
    host = request.headers["host"]
    name = request.url.hostname or ""
    behind_proxy = bool(access.proxies)
    if is_loopback(access.host) and not behind_proxy:
        return None
    if not is_loopback(name):
        return f"{scheme}://{host}"
    named = sorted(filter(_is_for_others, access.names), key=lambda each: (_is_number(each), each))
    if behind_proxy or not named:  # the port at a proxy's name is the proxy's, which nobody has told
        return None
    port = (request.scope.get("server") or ("", None))[1]
    return f"{scheme}://{_in_address(named[0])}:{port}"


def _is_for_others(name: str) -> bool:
    return not is_loopback(name) and name not in {"0.0.0.0", "::"}  # noqa: S104 - no address is bound here


def _is_number(name: str) -> bool:
    try:
        ip_address(name)
    except ValueError:
        return False
    return True


def _in_address(name: str) -> str:
    return f"[{name}]" if ":" in name else name


def qr_svg(text: str) -> str:
    """A QR code as SVG, one unit to a module, black on white: cameras expect it so, also in a dark room.

    It can be read with up to 15 % of it covered (level M).

    Args:
        text: at most some 1000 characters.
    """
    wanted = cv2.QRCodeEncoder.Params()
    wanted.mode, wanted.correction_level = cv2.QRCODE_ENCODER_MODE_BYTE, cv2.QRCODE_ENCODER_CORRECT_LEVEL_M
    dark = np.asarray(cv2.QRCodeEncoder.create(wanted).encode(text)) == 0
    rows, columns = np.flatnonzero(dark.any(axis=1)), np.flatnonzero(dark.any(axis=0))
    dark = dark[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    side = len(dark) + 2 * _QR_MARGIN
    path = "".join(f"M{column + _QR_MARGIN} {row + _QR_MARGIN}h1v1h-1z" for row, column in np.argwhere(dark))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {side} {side}" shape-rendering="crispEdges">'
        f'<path fill="#fff" d="M0 0h{side}v{side}H0z"/><path d="{path}"/></svg>'
    )
