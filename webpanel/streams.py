"""Answers that take long, or go on for ever: how many there may be at once, and that they end when the service does."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from http import HTTPStatus

from webpanel.problems import ProblemError


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
        """Whether the service is about to end: streams are to end now."""
        return self._ending.is_set()

    def end(self) -> None:
        """Have all streams end."""
        self._ending.set()

    async def ended_within(self, seconds: float) -> bool:
        """Wait, but no longer than until the streams are to end; True if they are."""
        try:
            await asyncio.wait_for(self._ending.wait(), seconds)
        except TimeoutError:
            return False
        return True

    @asynccontextmanager
    async def place(self) -> AsyncIterator[None]:
        """A place among the open streams, for as long as the stream lasts.

        Raises:
            ProblemError: 503, all are taken.
        """
        if self.open >= self._most:
            text = f"{self._most} are connected already, which is the most: close some, or try again later"
            raise ProblemError(HTTPStatus.SERVICE_UNAVAILABLE, "too_many_viewers", text, {"Retry-After": "5"})
        self.open += 1
        try:
            yield
        finally:
            self.open -= 1
