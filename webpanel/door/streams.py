"""Limits long answers (streams, waits for a picture, downloads) and threads of slow work; ends endless answers."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from http import HTTPStatus

from anyio import CapacityLimiter

from webpanel.problems import ProblemError

_EVENT_STREAMS_MAX = 64
_PREVIEW_STREAMS_MAX = 16
_PICTURES_MAX = 64
_DOWNLOADS_MAX = 8  # recording comes first at the disk


class Streams:
    """The open streams of one kind.

    Attributes:
        open: how many there are.
    """

    def __init__(self, most: int) -> None:
        self.open = 0
        self._most = most
        self._ending = asyncio.Event()

    @property
    def ending(self) -> bool:
        """Whether the service is shutting down: each stream ends itself then."""
        return self._ending.is_set()

    def end(self) -> None:
        """Tell all streams to end."""
        self._ending.set()

    async def ended_within(self, seconds: float) -> bool:
        """Wait for so long, or until the streams are told to end; True if they are."""
        try:
            await asyncio.wait_for(self._ending.wait(), seconds)
        except TimeoutError:
            return False
        return True

    @asynccontextmanager
    async def place(self) -> AsyncIterator[None]:
        """Count a stream as open while it lasts.

        Raises:
            ProblemError: 503, the largest number are open.
        """
        if self.open >= self._most:
            text = f"{self._most} are connected already, which is the most: close some, or try again later"
            raise ProblemError(HTTPStatus.SERVICE_UNAVAILABLE, "too_many_viewers", text, {"Retry-After": "5"})
        self.open += 1
        try:
            yield
        finally:
            self.open -= 1


@dataclass(frozen=True, slots=True)
class OpenStreams:
    """The open streams of all kinds; all together they leave room among the server's connections for commands."""

    events: Streams = field(default_factory=lambda: Streams(_EVENT_STREAMS_MAX))
    previews: Streams = field(default_factory=lambda: Streams(_PREVIEW_STREAMS_MAX))
    pictures: Streams = field(default_factory=lambda: Streams(_PICTURES_MAX))
    downloads: Streams = field(default_factory=lambda: Streams(_DOWNLOADS_MAX))

    def end(self) -> None:
        """Tell event streams, previews and checksums to end; a download and a wait for a picture end by themselves."""
        self.events.end()
        self.previews.end()
        self.downloads.end()


@dataclass(frozen=True, slots=True)
class Threads:
    """Threads for slow work: its callers must not take all of them from those who want to stop a recording.

    Attributes:
        doctor: examine the rig, some seconds each.
        reading: read and encode images of recordings.
        summing: read whole logs for their checksums.
        aiming: wait for pictures of single cameras, for those who set them up.
        waiting: wait for changes of what is measured by hand: those of so many pages.
    """

    doctor: CapacityLimiter = field(default_factory=lambda: CapacityLimiter(1))
    reading: CapacityLimiter = field(default_factory=lambda: CapacityLimiter(2))
    summing: CapacityLimiter = field(default_factory=lambda: CapacityLimiter(1))
    aiming: CapacityLimiter = field(default_factory=lambda: CapacityLimiter(4))
    waiting: CapacityLimiter = field(default_factory=lambda: CapacityLimiter(32))
