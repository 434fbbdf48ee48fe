"""Routes that look into a recording: its pulses, its images."""

from http import HTTPStatus
from typing import Annotated

import anyio
import numpy as np
from anyio.to_thread import run_sync
from fastapi import APIRouter, Path, Query, Response
from numpy.typing import NDArray

from rig.status import Pulses, RecordingState
from service.seam import RigService
from webpanel.problems import ProblemError
from webpanel.routes.common import RecordingId, jpeg_answer, refusals, strict_router
from webpanel.routes.preview import to_jpeg

_THUMBNAIL_WIDTH = 480
#: So many thumbnails are kept in memory, some 10 kB each: every phone and laptop looks at the same ones.
_THUMBNAILS_MAX = 1000
#: An image of a closed log never changes.
_KEPT = {"Cache-Control": "private, max-age=31536000, immutable"}
#: Threads that read and encode images. They are few, so that looking through a recording never slows down recording.
_READERS = 2


def contents_router(service: RigService) -> APIRouter:
    """The routes that read recordings."""
    router = strict_router("Recordings")
    readers = anyio.CapacityLimiter(_READERS)
    thumbnails: dict[tuple[object, ...], bytes] = {}

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
        recording = await run_sync(service.recording, recording_id, limiter=readers)
        final = recording.state is RecordingState.FINISHED
        key = recording.id, recording.bytes, recording.started
        if (jpeg := thumbnails.pop(key, None)) is None:
            jpeg = await run_sync(_thumbnail, service, recording_id, limiter=readers)
        if final:
            thumbnails[key] = jpeg  # the newest stands last
            if len(thumbnails) > _THUMBNAILS_MAX:
                del thumbnails[next(iter(thumbnails))]
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


def _thumbnail(service: RigService, recording_id: str) -> bytes:
    """The triplet that shows the recording best, small."""
    return _jpeg(service, recording_id, service.liveliest_pulse(recording_id), None, _THUMBNAIL_WIDTH)
