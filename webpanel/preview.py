"""The newest triplet as JPEG, encoded once however many look at it."""

import asyncio
from dataclasses import dataclass

import anyio
import anyio.to_thread
import cv2
import numpy as np
from numpy.typing import NDArray

from rig.errors import SvevError
from webpanel.rig_service import Preview, RigService

_APART_S = 0.1  # ten pictures a second are plenty to look at
_WAIT_S = 1.0
_WIDTH_MAX = 1280
_QUALITY = 80


@dataclass(frozen=True, slots=True)
class Picture:
    """One encoded triplet.

    Attributes:
        pulse: number of its pulse.
        statuses: what became of it in each camera, e.g. `ok,ok,lost`.
    """

    pulse: int
    statuses: str
    jpeg: bytes


class PreviewFeed:
    """Hands out pictures. Nothing runs while nobody looks."""

    def __init__(self, service: RigService) -> None:
        self._service = service
        self._newest: Picture | None = None
        self._made_at = 0.0
        self._making: asyncio.Task[Picture | None] | None = None
        self._one_thread = anyio.CapacityLimiter(1)

    async def other_than(self, pulse: int | None) -> Picture | None:
        """The newest picture, as soon as it shows another pulse than this; None if none came within a second.

        Args:
            pulse: what was seen last, None: nothing.
        """
        fresh = asyncio.get_running_loop().time() - self._made_at < _APART_S
        if fresh and self._newest is not None and self._newest.pulse != pulse:
            return self._newest
        if self._making is None or self._making.done():
            self._making = asyncio.create_task(self._make(-1 if pulse is None else pulse))
        # Whoever goes away leaves the others their picture.
        return await asyncio.shield(self._making)

    async def _make(self, pulse: int) -> Picture | None:
        loop = asyncio.get_running_loop()
        await asyncio.sleep(max(0.0, self._made_at + _APART_S - loop.time()))
        picture = await anyio.to_thread.run_sync(self._grab, pulse, limiter=self._one_thread)
        if picture is not None:
            self._newest, self._made_at = picture, loop.time()
        return picture

    def _grab(self, pulse: int) -> Picture | None:
        preview = self._service.preview(pulse, _WAIT_S)
        return None if preview is None else _to_picture(preview)


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


def _to_picture(preview: Preview) -> Picture:
    statuses = ",".join(status.value for status in preview.statuses)
    return Picture(preview.pulse, statuses, to_jpeg(preview.pixels, _WIDTH_MAX))
