"""Routes that show the rig live: the newest triplet as JPEG, single or as a stream, encoded once for all viewers.

And single cameras, for those who set them up: whole pictures, and figures of focus and exposure.
"""

from http import HTTPStatus
from typing import Annotated

import cv2
import numpy as np
from anyio.to_thread import run_sync
from fastapi import Path, Query, Response
from fastapi.responses import StreamingResponse
from numpy.typing import NDArray

from rig.api.cameras.aids import CameraAids
from rig.api.cameras.balls import CameraBalls
from rig.api.cameras.light import CameraLight, LightChange
from rig.pulse import RigPulse
from service.seam.cameras import CloseUp
from service.seam.rig import RigService
from webpanel.previews import BOUNDARY, WAIT_S, to_jpeg
from webpanel.problems import ProblemError
from webpanel.routes.common import CHANGING, Responses, jpeg_answer, refusals, strict_router
from webpanel.routes.dependencies import A_PICTURE, A_PREVIEW, Service, TheFeed, TheThreads

_CONTENT = {"multipart/x-mixed-replace": {"schema": {"type": "string", "format": "binary"}}}
_NOTHING_NEW: Responses = {204: {"description": "No other pulse has come within a second."}}
_Camera = Annotated[str, Path(pattern="^[A-Za-z][A-Za-z0-9_-]{0,15}$", description="name of a camera", examples=["K1"])]
_After = Annotated[int, Query(ge=-1, lt=2**63, description="pulse seen last; -1: none yet")]
#: Where a picture is in focus it is painted so (blue, green, red): no snow, sky or suit has this colour.
_PEAKING_COLOUR = (255, 0, 255)
_STREAM: Responses = {200: {"description": "Pictures, one after the other.", "content": _CONTENT}}

router = strict_router("Watching")


@router.get(
    "/preview.jpg",
    response_class=Response,
    dependencies=[A_PICTURE],
    responses=jpeg_answer("The triplet.") | _NOTHING_NEW | refusals(404, 503),
)
async def get_preview(
    feed: TheFeed,
    after: Annotated[int | None, Query(ge=0, lt=2**63, description="pulse seen last; 0: none yet")] = None,
) -> Response:
    """The newest triplet, the cameras side by side. The headers say which pulse it is.

    With `after` the answer waits up to a second for another pulse than this, and is 204 if none has come. A viewer
    that asks for the next picture when it shows the last one gets as many as its connection carries.
    """
    picture = await feed.other_than(None if after is None else RigPulse(after))
    if after is not None and (picture is None or picture.pulse == after):
        return Response(status_code=HTTPStatus.NO_CONTENT)
    if picture is None:
        text = "no triplet has come: arm the rig, and see that pulses arrive"
        raise ProblemError(HTTPStatus.NOT_FOUND, "no_preview", text)
    return Response(picture.jpeg, media_type="image/jpeg", headers=picture.headers())


@router.get(
    "/preview.mjpg",
    response_class=StreamingResponse,
    dependencies=[A_PREVIEW],
    responses=_STREAM | refusals(503),
)
async def watch_preview(feed: TheFeed) -> StreamingResponse:
    """The newest triplets, at most ten a second, as a stream that an `<img>` shows. Ends after 30 s without any."""
    return StreamingResponse(feed.parts(), media_type=f"multipart/x-mixed-replace; boundary={BOUNDARY}")


@router.get("/cameras/{camera}/balls", responses=refusals(404))
def get_camera_balls(service: Service, camera: _Camera) -> CameraBalls:
    """Where the camera's pictures should show the balls of the survey, to be drawn over the live picture.

    `source` says what this follows from: the poses that the rig file names (`calibration`), the last orientation by
    the live analysis (`orientation`), the approximate pose in the survey, or the planned station (`plan`). If there
    is none of these, `statement` says what to do. Works also while the rig is not armed.
    """
    return service.camera_balls(camera)


@router.get("/cameras/{camera}", responses=refusals(404))
def get_camera(service: Service, camera: _Camera) -> CameraLight:
    """Exposure, gain and region of a camera, and which regions it takes."""
    return service.camera_light(camera)


@router.patch("/cameras/{camera}", responses=CHANGING | refusals(404))
def change_camera(service: Service, camera: _Camera, change: LightChange) -> CameraLight:
    """Change exposure or gain of a camera; while armed it is connected anew with them, which takes a second or two.

    Another `region` makes an armed rig be armed anew, which takes some seconds; the answer comes when it is. If the
    camera or a check of arming refuses the region, the rig goes back to the one before, and the answer says why.
    Calibrations belong to a region: `calibration` says if they no longer fit.

    Not while a recording runs: all its frames are to be alike. The logs from then on hold the rig file with what
    was changed. `save` writes it into the rig file too; else it holds until the service ends.
    """
    return service.change_light(camera, change)


@router.get(
    "/cameras/{camera}/aids",
    response_model=CameraAids,
    dependencies=[A_PICTURE],
    responses=_NOTHING_NEW | refusals(404, 503),
)
async def get_camera_aids(
    service: Service, threads: TheThreads, camera: _Camera, after: _After = -1
) -> CameraAids | Response:
    """How sharp and how well exposed the newest frame of a camera is, for turning its lens.

    Waits up to a second for another pulse than `after`; 204 if none has come. Made of what the preview shows: of
    pixels of 10 and 12 bits the highest eight.
    """
    found = await run_sync(service.camera_aids, camera, RigPulse(after), WAIT_S, limiter=threads.aiming)
    return Response(status_code=HTTPStatus.NO_CONTENT) if found is None else found


@router.get(
    "/cameras/{camera}/picture.jpg",
    response_class=Response,
    dependencies=[A_PICTURE],
    responses=jpeg_answer("The frame.") | _NOTHING_NEW | refusals(404, 503),
)
async def get_camera_picture(
    service: Service,
    threads: TheThreads,
    camera: _Camera,
    after: _After = -1,
    peaking: Annotated[bool, Query(description="paint what is in focus magenta")] = False,
) -> Response:
    """The newest frame of a camera in its full size. Waits as `/cameras/{camera}/aids` does."""
    found = await run_sync(_close_up, service, camera, RigPulse(after), peaking, limiter=threads.aiming)
    if found is None:
        return Response(status_code=HTTPStatus.NO_CONTENT)
    frame, jpeg = found
    headers = {"X-Svev-Pulse": str(frame.pulse), "X-Svev-Statuses": frame.status.value}
    return Response(jpeg, media_type="image/jpeg", headers=headers)


def _close_up(service: RigService, camera: str, after: RigPulse, peaking: bool) -> tuple[CloseUp, bytes] | None:
    """The newest frame of a camera, and its picture; None if no other one than that of a pulse has come."""
    found = service.close_up(camera, after, WAIT_S, peaking=peaking)
    return None if found is None else (found, to_jpeg(_painted(found)))


def _painted(frame: CloseUp) -> NDArray[np.uint8]:
    """The picture; where it is in focus, painted."""
    if frame.sharp is None:
        return frame.pixels
    coloured = frame.pixels if frame.pixels.ndim > 2 else cv2.cvtColor(frame.pixels, cv2.COLOR_GRAY2BGR)
    picture = np.array(coloured, np.uint8)
    picture[frame.sharp] = _PEAKING_COLOUR
    return picture
