"""Routes that read a recording: its file, its pulses, its images."""

import pathlib
import re
from http import HTTPStatus
from typing import Annotated, Final

import anyio
import numpy as np
from anyio.to_thread import run_sync
from fastapi import APIRouter, Depends, Path, Query, Response
from fastapi.responses import FileResponse
from numpy.typing import NDArray
from starlette.datastructures import Headers
from starlette.types import Receive, Scope, Send

from rig.status import Pulses, RecordingState
from service.seam import RigService
from webpanel.door.streams import Streams
from webpanel.problems import ProblemError, problem
from webpanel.routes.common import RecordingId, Responses, jpeg_answer, refusals, strict_router
from webpanel.routes.preview import to_jpeg

_THUMBNAIL_WIDTH = 480
#: An image of a closed log never changes.
_KEPT = {"Cache-Control": "private, max-age=31536000, immutable"}
#: Threads that read and encode images. They are few, so that looking through a recording never slows down recording.
_READERS = 2
_FILE = {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}}
_LOG: Responses = {
    200: {"description": "The whole log.", "content": _FILE},
    206: {"description": "A part of the log.", "content": _FILE},
}
_RANGES: Final = re.compile(r"bytes\s*=\s*(\d{1,18}-\d{0,18}|-\d{1,18})(\s*,\s*(\d{1,18}-\d{0,18}|-\d{1,18}))*\s*")


def contents_router(service: RigService, downloads: Streams) -> APIRouter:
    """The routes that read recordings."""
    router = strict_router("Recordings")
    readers = anyio.CapacityLimiter(_READERS)

    @router.get(
        "/recordings/{recording_id}/file",
        response_class=FileResponse,
        dependencies=[Depends(downloads.place)],
        responses=_LOG | refusals(404, 409, 416, 503),
    )
    def download_recording(recording_id: RecordingId) -> RecordingFile:
        """The log as a file, whole or by a `Range`; with `ETag` and `If-Range`, so that a download can be resumed."""
        return RecordingFile(recording_id, service.log_file(recording_id))

    @router.head("/recordings/{recording_id}/file", include_in_schema=False)
    def head_recording(recording_id: RecordingId) -> RecordingFile:
        return RecordingFile(recording_id, service.log_file(recording_id))

    @router.get("/recordings/{recording_id}/pulses", responses=refusals(404))
    async def list_pulses(recording_id: RecordingId) -> Pulses:
        """What became of each pulse in each camera."""
        return await run_sync(service.pulses, recording_id, limiter=readers)

    @router.get(
        "/recordings/{recording_id}/pulses/{pulse}.jpg",
        response_class=Response,
        responses=jpeg_answer("The triplet, or one camera's part of it.") | refusals(404),
    )
    async def get_image(
        recording_id: RecordingId,
        pulse: Annotated[int, Path(ge=1, le=2**53, description="number of the pulse", examples=[1])],
        camera: Annotated[str | None, Query(max_length=100, description="only this camera", examples=["K2"])] = None,
        width: Annotated[int | None, Query(ge=16, le=8192, description="at most so many columns")] = None,
    ) -> Response:
        """One triplet of a recording, the cameras side by side."""
        jpeg = await run_sync(_jpeg, service, recording_id, pulse, camera, width, limiter=readers)
        return Response(jpeg, media_type="image/jpeg", headers=_KEPT)

    @router.get(
        "/recordings/{recording_id}/thumbnail.jpg",
        response_class=Response,
        responses=jpeg_answer("A triplet in which most moves, 480 columns wide.") | refusals(404),
    )
    async def get_thumbnail(recording_id: RecordingId) -> Response:
        """A small picture of a recording."""
        jpeg, final = await run_sync(_thumbnail, service, recording_id, limiter=readers)
        return Response(jpeg, media_type="image/jpeg", headers=_KEPT if final else None)

    return router


def _jpeg(service: RigService, recording_id: str, pulse: int, camera: str | None, width: int | None) -> bytes:
    """One triplet, or one camera's part of it, encoded."""
    image = service.image(recording_id, pulse)
    return to_jpeg(image if camera is None else _block(service.pulses(recording_id), image, camera), width)


def _block(pulses: Pulses, image: NDArray[np.uint8], camera: str) -> NDArray[np.uint8]:
    """One camera's columns of a triplet."""
    if camera not in pulses.cameras:
        known = ", ".join(pulses.cameras)
        raise ProblemError(HTTPStatus.NOT_FOUND, "unknown_camera", f"no camera of this name: choose among {known}")
    first, end = pulses.columns[pulses.cameras.index(camera)]
    return np.ascontiguousarray(image[:, first:end])


def _thumbnail(service: RigService, recording_id: str) -> tuple[bytes, bool]:
    """The triplet that shows the recording best, small; whether it will stay this one."""
    final = service.recording(recording_id).state is RecordingState.FINISHED
    return _jpeg(service, recording_id, service.liveliest_pulse(recording_id), None, _THUMBNAIL_WIDTH), final


class RecordingFile(FileResponse):
    """A log to download.

    A `Range` header that cannot be understood is ignored (RFC 9110, 14.2); a range beyond the end is refused with 416.
    """

    def __init__(self, recording_id: str, path: pathlib.Path) -> None:
        super().__init__(
            path, media_type="application/octet-stream", filename=f"{recording_id}.mcap", stat_result=path.stat()
        )

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
