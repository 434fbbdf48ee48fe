"""What is in a recording: the file, its pulses, its images."""

from collections.abc import AsyncIterator
from http import HTTPStatus
from typing import Annotated

import anyio
import anyio.to_thread
import numpy as np
from fastapi import APIRouter, Depends, Path, Query, Response
from fastapi.responses import FileResponse
from numpy.typing import NDArray

from recorder.catalogue import Catalogue
from recorder.catalogue_entry import LogState
from webpanel.api_errors import Responses, jpeg_answer, refusals
from webpanel.models import Pulses
from webpanel.preview import to_jpeg
from webpanel.problems import ProblemError
from webpanel.recording_file import RecordingFile
from webpanel.recording_view import to_pulses
from webpanel.rig_service import RigService
from webpanel.routes_recordings import RecordingId
from webpanel.streams import Streams
from webpanel.strict_route import strict_router

_THUMBNAIL_WIDTH = 480
_KEPT = {"Cache-Control": "private, max-age=31536000, immutable"}
#: Images are read and encoded by so many threads at once: whoever scrubs does not take the computer from a recording.
_READERS = 2
_FILE = {"application/octet-stream": {"schema": {"type": "string", "format": "binary"}}}
_LOG: Responses = {
    200: {"description": "The whole log.", "content": _FILE},
    206: {"description": "A part of the log.", "content": _FILE},
}


class Contents:
    """Pulses and images of recordings, read by few threads at once."""

    def __init__(self, catalogue: Catalogue) -> None:
        self._catalogue = catalogue
        self._readers = anyio.CapacityLimiter(_READERS)

    async def pulses(self, recording_id: str) -> Pulses:
        """What became of each pulse."""
        return await anyio.to_thread.run_sync(self._pulses, recording_id, limiter=self._readers)

    async def jpeg(self, recording_id: str, pulse: int, camera: str | None, width: int | None) -> bytes:
        """One triplet, or one camera's part of it."""
        return await anyio.to_thread.run_sync(self._jpeg, recording_id, pulse, camera, width, limiter=self._readers)

    async def thumbnail(self, recording_id: str) -> tuple[bytes, bool]:
        """The triplet that stands for the recording; whether it will stay this one."""
        return await anyio.to_thread.run_sync(self._thumbnail, recording_id, limiter=self._readers)

    def _pulses(self, recording_id: str) -> Pulses:
        return to_pulses(recording_id, self._catalogue.tags(recording_id))

    def _jpeg(self, recording_id: str, pulse: int, camera: str | None, width: int | None) -> bytes:
        image = self._catalogue.image(recording_id, pulse)
        return to_jpeg(image if camera is None else self._block(recording_id, image, camera), width)

    def _block(self, recording_id: str, image: NDArray[np.uint8], camera: str) -> NDArray[np.uint8]:
        pulses = self._pulses(recording_id)
        if camera not in pulses.cameras:
            known = ", ".join(pulses.cameras)
            raise ProblemError(HTTPStatus.NOT_FOUND, "unknown_camera", f"no camera of this name: choose among {known}")
        first, end = pulses.columns[pulses.cameras.index(camera)]
        return np.ascontiguousarray(image[:, first:end])

    def _thumbnail(self, recording_id: str) -> tuple[bytes, bool]:
        final = self._catalogue.entry(recording_id).state is LogState.CLOSED
        return self._jpeg(recording_id, self._catalogue.liveliest_pulse(recording_id), None, _THUMBNAIL_WIDTH), final


def images_router(service: RigService, catalogue: Catalogue, downloads: Streams) -> APIRouter:
    """The routes that read recordings."""
    router = strict_router("Recordings")
    contents = Contents(catalogue)

    async def place() -> AsyncIterator[None]:
        async with downloads.place():
            yield

    def file_of(recording_id: str) -> RecordingFile:
        current = service.status().recording
        if current and current.id == recording_id:
            text = f"recording {recording_id} is still being written: stop it first"
            raise ProblemError(HTTPStatus.CONFLICT, "still_recording", text)
        return RecordingFile(recording_id, catalogue.entry(recording_id).path)

    @router.get(
        "/recordings/{recording_id}/file",
        response_class=FileResponse,
        dependencies=[Depends(place)],
        responses=_LOG | refusals(404, 409, 416, 503),
    )
    def download_recording(recording_id: RecordingId) -> RecordingFile:
        """The log as a file, whole or by a `Range`; with `ETag` and `If-Range`, so that a download can be resumed."""
        return file_of(recording_id)

    @router.head("/recordings/{recording_id}/file", include_in_schema=False)
    def head_recording(recording_id: RecordingId) -> RecordingFile:
        return file_of(recording_id)

    @router.get("/recordings/{recording_id}/pulses", responses=refusals(404))
    async def list_pulses(recording_id: RecordingId) -> Pulses:
        """What became of each pulse in each camera."""
        return await contents.pulses(recording_id)

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
        return Response(await contents.jpeg(recording_id, pulse, camera, width), media_type="image/jpeg", headers=_KEPT)

    @router.get(
        "/recordings/{recording_id}/thumbnail.jpg",
        response_class=Response,
        responses=jpeg_answer("A triplet in which most moves, 480 columns wide.") | refusals(404),
    )
    async def get_thumbnail(recording_id: RecordingId) -> Response:
        """A small picture of a recording."""
        jpeg, final = await contents.thumbnail(recording_id)
        return Response(jpeg, media_type="image/jpeg", headers=_KEPT if final else None)

    return router
