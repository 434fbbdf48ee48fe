"""Routes that hand out recordings as files: one, whole or in parts, its checksum, and several as one archive."""

import asyncio
import os
import re
import threading
import unicodedata
from base64 import b64encode
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from email.utils import formatdate
from http import HTTPStatus
from typing import Annotated, Any, Final
from urllib.parse import quote, unquote

import anyio
from anyio.to_thread import run_sync
from fastapi import Query, Request, Response
from fastapi.responses import FileResponse, PlainTextResponse, StreamingResponse
from starlette.datastructures import Headers
from starlette.types import Receive, Scope, Send

from service.seam.archive import Download
from service.seam.rig import RigService
from webpanel.door.streams import Streams
from webpanel.problems import problem
from webpanel.routes.common import RecordingId, Responses, refusals, strict_router
from webpanel.routes.dependencies import A_DOWNLOAD, Service, TheStreams, TheThreads

_BINARY: Final = {"schema": {"type": "string", "format": "binary"}}
_LOG: Final = {"application/octet-stream": _BINARY}
_FILE: Responses = {
    200: {"description": "The whole log.", "content": _LOG},
    206: {"description": "A part of the log.", "content": _LOG},
}
_ZIP: Responses = {200: {"description": "The archive.", "content": {"application/zip": _BINARY}}}
_SUM: Responses = {
    200: {
        "description": "The checksum, as `sha256sum -c` reads it.",
        "content": {
            "text/plain": {"schema": {"type": "string"}, "example": f"{'0' * 64}  17_Ola-Nordmann_jump-7.mcap\n"}
        },
    }
}
_RANGES: Final = re.compile(r"bytes\s*=\s*(\d{1,18}-\d{0,18}|-\d{1,18})(\s*,\s*(\d{1,18}-\d{0,18}|-\d{1,18}))*\s*")
#: As many as fit into an address.
_TOGETHER_MAX: Final = 500
Ids = Annotated[
    str,
    Query(
        pattern=rf"^[^,]+(,[^,]+){{0,{_TOGETHER_MAX - 1}}}$",
        description=(
            f"ids of the recordings, each percent-encoded if it holds a comma or %, with commas between, at most "
            f"{_TOGETHER_MAX}"
        ),
        examples=["jump-1,jump-2"],
    ),
]
#: So often the work for a client looks whether it is still there, s.
_LOOK_S: Final = 0.2
#: Letters without an accent that could be taken off.
_PLAIN: Final = str.maketrans(
    {"ø": "o", "Ø": "O", "æ": "ae", "Æ": "Ae", "đ": "d", "Đ": "D", "ł": "l", "Ł": "L", "ß": "ss", "ð": "d", "þ": "th"}
)

_QUOTES: Final = str.maketrans(dict.fromkeys('"/\\', "-"))


@asynccontextmanager
async def _still_wanted(request: Request, downloads: Streams) -> AsyncIterator[Callable[[], bool]]:
    """What long work in a thread asks: whether the client still waits, and the service goes on."""
    over = threading.Event()

    async def watch() -> None:
        while not await request.is_disconnected() and not await downloads.ended_within(_LOOK_S):
            pass
        over.set()

    watching = asyncio.create_task(watch())
    try:
        yield lambda: not over.is_set()
    finally:
        over.set()
        watching.cancel()


class RecordingFile(FileResponse):
    """A recording to download.

    A `Range` header that cannot be understood is ignored (RFC 9110, 14.2); a range beyond the end is refused with 416.
    """

    chunk_size = 256 << 10

    def __init__(self, download: Download, checksum: str) -> None:
        headers = {
            "Content-Disposition": attachment(download.name),
            "ETag": f'"{download.tag}"',
            "Last-Modified": formatdate(download.modified, usegmt=True),
            "X-Svev-Session": "corrected" if download.corrected else "as-recorded",
        }
        if checksum:  # RFC 9530
            headers["Repr-Digest"] = f"sha-256=:{b64encode(bytes.fromhex(checksum)).decode()}:"
        stat = os.stat_result((0, 0, 0, 1, 0, 0, download.size, 0, int(download.modified), 0))
        super().__init__(download.name, headers=headers, media_type="application/octet-stream", stat_result=stat)
        self._download = download

    @asynccontextmanager
    async def _open_file(self) -> AsyncIterator[anyio.AsyncFile[Any]]:
        """What the framework reads from: the corrected log, which is no file on the disk."""
        file = anyio.wrap_file(await run_sync(self._download.open))
        try:
            yield file
        finally:
            with anyio.CancelScope(shield=True):
                await file.aclose()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request."""
        asked = Headers(scope=scope).get("range")
        if asked is not None:
            size = int(self.headers["content-length"])
            spans = _spans(asked, size)
            if any(first >= size for first, _ in spans):
                text = f"the file has {size} bytes: ask for a range within it"
                headers = {"Content-Range": f"bytes */{size}"}
                status = HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE
                await problem(status, "range_not_satisfiable", text, headers)(scope, receive, send)
                return
            if not spans or any(first > last for first, last in spans):
                scope = {**scope, "headers": [pair for pair in scope["headers"] if pair[0] != b"range"]}
        await super().__call__(scope, receive, send)


router = strict_router("Recordings")


def _answer(service: RigService, recording_id: str) -> RecordingFile:
    download = service.download(recording_id)
    return RecordingFile(download, service.known_checksum(download))


@router.get(
    "/recordings/{recording_id}/file",
    response_class=FileResponse,
    dependencies=[A_DOWNLOAD],
    responses=_FILE | refusals(404, 409, 416, 503),
)
def download_recording(service: Service, recording_id: RecordingId) -> RecordingFile:
    """The log as a file, with the session as it was corrected: only its metadata differ from the recorded log.

    Whole or by a `Range`; with `ETag` and `If-Range`, so that a download can be resumed. The header
    `X-Svev-Session` says whether the session is `corrected` or `as-recorded`.
    """
    return _answer(service, recording_id)


@router.head("/recordings/{recording_id}/file", include_in_schema=False)
def head_recording(service: Service, recording_id: RecordingId) -> RecordingFile:
    """The headers of the log as a file."""
    return _answer(service, recording_id)


@router.get(
    "/recordings/{recording_id}/file.sha256",
    response_class=PlainTextResponse,
    dependencies=[A_DOWNLOAD],
    responses=_SUM | refusals(404, 409, 503),
)
async def get_checksum(
    service: Service, streams: TheStreams, threads: TheThreads, recording_id: RecordingId, request: Request
) -> PlainTextResponse:
    """SHA-256 of the file as it is handed out, corrected session and all.

    The first call reads the whole log; from then on the file carries it as `Repr-Digest` (RFC 9530).
    """
    async with _still_wanted(request, streams.downloads) as wanted:
        checksum = await run_sync(service.checksum, recording_id, wanted, limiter=threads.summing)
    name = (await run_sync(service.download, recording_id)).name
    return PlainTextResponse(f"{checksum}  {name}\n")


@router.get(
    "/recordings.zip",
    response_class=StreamingResponse,
    dependencies=[A_DOWNLOAD],
    responses=_ZIP | refusals(404, 409, 503),
)
def download_together(service: Service, ids: Ids) -> StreamingResponse:
    """Several recordings as one ZIP archive without compression; `SHA256SUMS` in it has their checksums."""
    size, pieces = service.zipped(_split(ids))
    return StreamingResponse(pieces, media_type="application/zip", headers=_zip_headers(ids, size))


@router.head("/recordings.zip", include_in_schema=False)
def head_together(service: Service, ids: Ids) -> Response:
    """The headers of several recordings as one archive."""
    size, _ = service.zipped(_split(ids))
    return Response(media_type="application/zip", headers=_zip_headers(ids, size))


def _split(ids: str) -> list[str]:
    return [unquote(each) for each in ids.split(",")]


def _zip_headers(ids: str, size: int) -> dict[str, str]:
    name = f"svev_{len(set(_split(ids)))}-jumps.zip"
    return {"Content-Disposition": f'attachment; filename="{name}"', "Content-Length": str(size)}


def attachment(name: str) -> str:
    """The header that names a file; other letters than ASCII in the extended form (RFC 6266, 4.3)."""
    apart = unicodedata.normalize("NFKD", name.translate(_PLAIN)).encode("ascii", "ignore").decode()
    apart = apart.translate(_QUOTES)  # wide letters fall apart into them
    extended = "" if apart == name else f"; filename*=UTF-8''{quote(name)}"
    return f'attachment; filename="{apart}"{extended}'


def _spans(text: str, size: int) -> list[tuple[int, int]]:
    """First and last byte of each range of a `Range` header; empty if the header is not understood."""
    if not _RANGES.fullmatch(text):
        return []
    spans = []
    for part in text.partition("=")[2].split(","):
        first, _, last = part.strip().partition("-")
        if first:
            spans.append((int(first), int(last) if last else size - 1))
        else:
            spans.append((max(size - int(last), 0) if int(last) else size, size - 1))
    return spans
