"""Pictures that many look at: the newest triplet, encoded once for all viewers, and thumbnails of recordings."""

import asyncio
from collections import OrderedDict
from collections.abc import AsyncIterator
from dataclasses import dataclass
from typing import Final

import anyio
import cv2
import numpy as np
from anyio.to_thread import run_sync
from numpy.typing import NDArray

from rig.errors import SvevError
from rig.pulse import RigPulse
from service.seam.rig import RigService
from webpanel.door.streams import OpenStreams

WAIT_S: Final = 1.0  #: so long a caller waits for the next picture
_APART_S: Final = 0.1  # least time between two pictures: the eye needs no more than ten a second
#: With more viewers than these the pictures come less often, so that serving them costs no more.
_VIEWERS_AT_FULL_RATE: Final = 16
_WIDTH_MAX: Final = 1280
_QUALITY: Final = 80
BOUNDARY: Final = "svev-triplet"
#: A stream ends after so many seconds without a picture; the page asks again.
_PATIENCE_S: Final = 30
#: So many thumbnails are kept in memory.
_THUMBNAILS_MAX: Final = 1000


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
        return lines.encode() + b"\r\n" + self.jpeg + f"\r\n--{BOUNDARY}\r\n".encode()


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
        preview = self._service.preview(pulse, WAIT_S)
        if preview is None:
            return None
        statuses = ",".join(status.value for status in preview.statuses)
        return Picture(preview.pulse, statuses, to_jpeg(preview.pixels, _WIDTH_MAX))

    async def parts(self) -> AsyncIterator[bytes]:
        """The pictures as parts of a multipart answer; ends when none comes any more, and at shutdown."""
        loop = asyncio.get_running_loop()
        seen, seen_at = None, loop.time()
        # A browser shows a picture when it has received the boundary behind it: each part ends in one.
        yield f"--{BOUNDARY}\r\n".encode()
        while not self._streams.previews.ending and loop.time() - seen_at < _PATIENCE_S:
            picture = await self.other_than(seen)
            if picture is not None and picture.pulse != seen:
                seen, seen_at = picture.pulse, loop.time()
                yield picture.part()


class Thumbnails:
    """Small pictures of recordings that have ended: every phone and laptop looks at the same ones."""

    def __init__(self) -> None:
        self._kept: OrderedDict[tuple[object, ...], bytes] = OrderedDict()

    def find(self, of: tuple[object, ...]) -> bytes | None:
        """A kept picture."""
        return self._kept.get(of)

    def keep(self, of: tuple[object, ...], jpeg: bytes) -> None:
        """Keep a picture as the newest one, some 10 kB; those that nobody has asked for the longest make room."""
        self._kept[of] = jpeg
        self._kept.move_to_end(of)
        if len(self._kept) > _THUMBNAILS_MAX:
            self._kept.popitem(last=False)


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
