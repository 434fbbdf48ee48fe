"""Routes that show the rig live: the newest triplet as JPEG, single or as a stream, encoded once for all viewers.

And single cameras, for those who set them up: whole pictures, and figures of focus and exposure.
"""

import asyncio
from collections.abc import AsyncIterator
from dataclasses import dataclass
from http import HTTPStatus
from typing import Annotated

import anyio
import cv2
import numpy as np
from anyio.to_thread import run_sync
from fastapi import APIRouter, Depends, Path, Query, Response
from fastapi.responses import StreamingResponse
from numpy.typing import NDArray

from rig.api.cameras.aids import CameraAids
from rig.api.cameras.balls import CameraBalls
from rig.api.cameras.light import CameraLight, LightChange
from rig.errors import SvevError
from rig.pulse import RigPulse
from service.seam.cameras import CloseUp
from service.seam.rig import RigService
from webpanel.door.streams import OpenStreams, Streams
from webpanel.problems import ProblemError
from webpanel.routes.common import CHANGING, Responses, jpeg_answer, refusals, strict_router

_APART_S = 0.1  # least time between two pictures: the eye needs no more than ten a second
#: With more viewers than these the pictures come less often, so that serving them costs no more.
_VIEWERS_AT_FULL_RATE = 16
_WAIT_S = 1.0
_WIDTH_MAX = 1280
_QUALITY = 80
_BOUNDARY = "svev-triplet"
#: A stream ends after so many seconds without a picture; the page asks again.
_PATIENCE_S = 30
_CONTENT = {"multipart/x-mixed-replace": {"schema": {"type": "string", "format": "binary"}}}
_NOTHING_NEW: Responses = {204: {"description": "No other pulse has come within a second."}}
_Camera = Annotated[str, Path(pattern="^[A-Za-z][A-Za-z0-9_-]{0,15}$", description="name of a camera", examples=["K1"])]
_After = Annotated[int, Query(ge=-1, lt=2**63, description="pulse seen last; -1: none yet")]
#: Where a picture is in focus it is painted so (blue, green, red): no snow, sky or suit has this colour.
_PEAKING_COLOUR = (255, 0, 255)
#: Of those who set up cameras so many are served at once; they must not keep others from stopping a recording.
_SETTING_UP = 4
_STREAM: Responses = {200: {"description": "Pictures, one after the other.", "content": _CONTENT}}


@dataclass(frozen=True, slots=True)
class Picture:
    """One encoded triplet.

    Attributes:
        pulse: number of its pulse since the recorder was started.
        statuses: what became of it in each camera, e.g. `ok,ok,lost`.
    """

    pulse: RigPulse
    statuses: str
    jpeg: bytes

    def headers(self) -> dict[str, str]:
        """The headers that say what is shown."""
        return {"X-Svev-Pulse": str(self.pulse), "X-Svev-Statuses": self.statuses}

    def part(self) -> bytes:
        """The picture as one part of a multipart answer, boundary at its end."""
        head = {"Content-Type": "image/jpeg", "Content-Length": str(len(self.jpeg))} | self.headers()
        lines = "".join(f"{name}: {value}\r\n" for name, value in head.items())
        return lines.encode() + b"\r\n" + self.jpeg + f"\r\n--{_BOUNDARY}\r\n".encode()


class PreviewFeed:
    """The newest picture, fetched and encoded only when a viewer asks, and once for all who ask meanwhile."""

    def __init__(self, service: RigService, streams: OpenStreams) -> None:
        self._service = service
        self._streams = streams
        self._newest: Picture | None = None
        self._made_at = 0.0
        self._making: asyncio.Task[Picture | None] | None = None
        self._one_thread = anyio.CapacityLimiter(1)

    async def other_than(self, pulse: RigPulse | None) -> Picture | None:
        """Wait for a picture of another pulse than this; None if none came within a second.

        Args:
            pulse: the pulse that the viewer saw last, None: no pulse yet.
        """
        fresh = asyncio.get_running_loop().time() - self._made_at < self._apart_s
        if fresh and self._newest is not None and self._newest.pulse != pulse:
            return self._newest
        if self._making is None or self._making.done():
            self._making = asyncio.create_task(self._make(RigPulse(-1) if pulse is None else pulse))
        # A viewer that disconnects must not cancel the picture that the others wait for.
        return await asyncio.shield(self._making)

    @property
    def _apart_s(self) -> float:
        viewers = self._streams.previews.open + self._streams.pictures.open
        return _APART_S * max(1.0, viewers / _VIEWERS_AT_FULL_RATE)

    async def _make(self, pulse: RigPulse) -> Picture | None:
        loop = asyncio.get_running_loop()
        await asyncio.sleep(max(0.0, self._made_at + self._apart_s - loop.time()))
        picture = await run_sync(self._grab, pulse, limiter=self._one_thread)
        if picture is not None:
            self._newest, self._made_at = picture, loop.time()
        return picture

    def _grab(self, pulse: RigPulse) -> Picture | None:
        preview = self._service.preview(pulse, _WAIT_S)
        if preview is None:
            return None
        statuses = ",".join(status.value for status in preview.statuses)
        return Picture(preview.pulse, statuses, to_jpeg(preview.pixels, _WIDTH_MAX))


def to_jpeg(pixels: NDArray[np.uint8], width: int | None = None) -> bytes:
    """Encode an image, made smaller if it is wider than `width`.

    Args:
        pixels: (rows, columns), uint8.
        width: at most so many columns, None: as it is.

    Raises:
        SvevError: it cannot be encoded.
    """
    if width is not None and width < pixels.shape[1]:
        height = max(1, round(pixels.shape[0] * width / pixels.shape[1]))
        pixels = np.asarray(cv2.resize(pixels, (width, height), interpolation=cv2.INTER_AREA), np.uint8)
    done, jpeg = cv2.imencode(".jpg", pixels, (cv2.IMWRITE_JPEG_QUALITY, _QUALITY))
    if not done:
        raise SvevError(
            f"an image of {pixels.shape[1]} x {pixels.shape[0]} pixels cannot be made a JPEG: ask for a smaller one"
        )
    return jpeg.tobytes()


def preview_router(service: RigService, streams: OpenStreams) -> APIRouter:
    """The routes of the preview."""
    router = strict_router("Watching")
    feed = PreviewFeed(service, streams)

    @router.get(
        "/preview.jpg",
        response_class=Response,
        dependencies=[Depends(streams.pictures.place)],
        responses=jpeg_answer("The triplet.") | _NOTHING_NEW | refusals(404, 503),
    )
    async def get_preview(
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
        dependencies=[Depends(streams.previews.place)],
        responses=_STREAM | refusals(503),
    )
    async def watch_preview() -> StreamingResponse:
        """The newest triplets, at most ten a second, as a stream that an `<img>` shows. Ends after 30 s without any."""
        return StreamingResponse(
            _parts(feed, streams.previews), media_type=f"multipart/x-mixed-replace; boundary={_BOUNDARY}"
        )

    return router


def cameras_router(service: RigService) -> APIRouter:
    """The routes of the settings of single cameras."""
    router = strict_router("Watching")

    @router.get("/cameras/{camera}/balls", responses=refusals(404))
    def get_camera_balls(camera: _Camera) -> CameraBalls:
        """Where the camera's pictures should show the balls of the survey, to be drawn over the live picture.

        `source` says what this follows from: the poses that the rig file names (`calibration`), the last orientation by
        the live analysis (`orientation`), the approximate pose in the survey, or the planned station (`plan`). If there
        is none of these, `statement` says what to do. Works also while the rig is not armed.
        """
        return service.camera_balls(camera)

    @router.get("/cameras/{camera}", responses=refusals(404))
    def get_camera(camera: _Camera) -> CameraLight:
        """Exposure, gain and region of a camera, and which regions it takes."""
        return service.camera_light(camera)

    @router.patch("/cameras/{camera}", responses=CHANGING | refusals(404))
    def change_camera(camera: _Camera, change: LightChange) -> CameraLight:
        """Change exposure or gain of a camera; while armed it is connected anew with them, which takes a second or two.

        Another `region` makes an armed rig be armed anew, which takes some seconds; the answer comes when it is. If the
        camera or a check of arming refuses the region, the rig goes back to the one before, and the answer says why.
        Calibrations belong to a region: `calibration` says if they no longer fit.

        Not while a recording runs: all its frames are to be alike. The logs from then on hold the rig file with what
        was changed. `save` writes it into the rig file too; else it holds until the service ends.
        """
        return service.change_light(camera, change)

    return router


def close_up_router(service: RigService, streams: OpenStreams) -> APIRouter:
    """The routes that show single cameras."""
    router = strict_router("Watching")
    at_once = anyio.CapacityLimiter(_SETTING_UP)

    def wait_for_aids(camera: str, after: int) -> CameraAids | None:
        return service.camera_aids(camera, RigPulse(after), _WAIT_S)

    def wait_for_picture(camera: str, after: int, peaking: bool) -> tuple[CloseUp, bytes] | None:
        found = service.close_up(camera, RigPulse(after), _WAIT_S, peaking=peaking)
        return None if found is None else (found, to_jpeg(_painted(found)))

    @router.get(
        "/cameras/{camera}/aids",
        response_model=CameraAids,
        dependencies=[Depends(streams.pictures.place)],
        responses=_NOTHING_NEW | refusals(404, 503),
    )
    async def get_camera_aids(camera: _Camera, after: _After = -1) -> CameraAids | Response:
        """How sharp and how well exposed the newest frame of a camera is, for turning its lens.

        Waits up to a second for another pulse than `after`; 204 if none has come. Made of what the preview shows: of
        pixels of 10 and 12 bits the highest eight.
        """
        found = await run_sync(wait_for_aids, camera, after, limiter=at_once)
        return Response(status_code=HTTPStatus.NO_CONTENT) if found is None else found

    @router.get(
        "/cameras/{camera}/picture.jpg",
        response_class=Response,
        dependencies=[Depends(streams.pictures.place)],
        responses=jpeg_answer("The frame.") | _NOTHING_NEW | refusals(404, 503),
    )
    async def get_camera_picture(
        camera: _Camera,
        after: _After = -1,
        peaking: Annotated[bool, Query(description="paint what is in focus magenta")] = False,
    ) -> Response:
        """The newest frame of a camera in its full size. Waits as `/cameras/{camera}/aids` does."""
        found = await run_sync(wait_for_picture, camera, after, peaking, limiter=at_once)
        if found is None:
            return Response(status_code=HTTPStatus.NO_CONTENT)
        frame, jpeg = found
        headers = {"X-Svev-Pulse": str(frame.pulse), "X-Svev-Statuses": frame.status.value}
        return Response(jpeg, media_type="image/jpeg", headers=headers)

    return router


def _painted(frame: CloseUp) -> NDArray[np.uint8]:
    """The picture; where it is in focus, painted."""
    if frame.sharp is None:
        return frame.pixels
    coloured = frame.pixels if frame.pixels.ndim > 2 else cv2.cvtColor(frame.pixels, cv2.COLOR_GRAY2BGR)
    picture = np.array(coloured, np.uint8)
    picture[frame.sharp] = _PEAKING_COLOUR
    return picture


async def _parts(feed: PreviewFeed, streams: Streams) -> AsyncIterator[bytes]:
    loop = asyncio.get_running_loop()
    seen, seen_at = None, loop.time()
    # A browser shows a picture when it has received the boundary behind it: each part ends in one.
    yield f"--{_BOUNDARY}\r\n".encode()
    while not streams.ending and loop.time() - seen_at < _PATIENCE_S:
        picture = await feed.other_than(seen)
        if picture is not None and picture.pulse != seen:
            seen, seen_at = picture.pulse, loop.time()
            yield picture.part()
