"""Triplets in a program of one's own, from a running rig and from a replayed log alike.

from svev.client import Client

with Client("tcp://127.0.0.1:5556") as client:
    for triplet in client:
        print(triplet.pulse, {name: frame.mean() for name, frame in triplet.frames.items()})
"""

import os
import time
from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Final, Self

from analysis.worker.stream import Received, Source, connected, public_key
from rig.frame import FrameStatus
from rig.images.pixels import Stored
from rig.pulse import PulseNumber
from rig.tag import TripletTag
from rig.topics import DEFAULT_PUBLISH

#: Without a timeout the client waits in spans of this length, s: poll() takes no longer one in one call.
_LONG_S: Final = 3600.0


@dataclass(frozen=True, slots=True, eq=False)
class Triplet:
    """One pulse in all cameras. All of it is of this pulse: a frame that did not come is not there.

    Attributes:
        tag: what became of the pulse in each camera.
        frames: by the names of the cameras from left to right, (rows, columns), uint8 or uint16, in memory of this
            triplet alone; only of those that delivered a frame.
        side_by_side: the frames as they are stored, (rows, columns); None if no camera delivered one.
    """

    tag: TripletTag
    frames: Mapping[str, Stored]
    side_by_side: Stored | None

    @property
    def pulse(self) -> PulseNumber:
        """Number of the pulse in its recording."""
        return self.tag.pulse

    @property
    def complete(self) -> bool:
        """Whether every camera delivered its frame."""
        return self.tag.complete


class Client:
    """Receives triplets; an iterator over them, and a context that closes the connection.

    It may be made before the publisher runs, and goes on when that is started again. One thread iterates; `stop` may be
    called by any thread and by a signal handler.

    Args:
        address: where triplets are published (`network.publish` of the rig file), or of `svev replay`.
        reliable: the address is that of `svev replay --reliable`, which waits for this program.
        key: the publisher's public key, a file of `svev keys`; None: it publishes without keys.
        timeout_s: the iteration ends when nothing has come for so long; None: it waits until `stop`.

    Attributes:
        missed: pulses between the first and the latest triplet of each recording that did not come: the program is too
            slow. Meaningless with `reliable` if several programs share a replay.
        refused: messages that were no triplets.

    Raises:
        BadInputError: the address is none of ZeroMQ, or the file holds no key.
    """

    def __init__(
        self,
        address: str = DEFAULT_PUBLISH,
        *,
        reliable: bool = False,
        key: Path | None = None,
        timeout_s: float | None = None,
    ) -> None:
        self.missed = 0
        self._timeout_s = timeout_s
        self._last: tuple[str, PulseNumber] | None = None
        self._stopped = False
        with ExitStack() as opened:
            self._wake = os.eventfd(0)
            opened.callback(os.close, self._wake)
            source = Source(address, reliable, None if key is None else public_key(key))
            self._stream = opened.enter_context(connected(source))
            self._opened = opened.pop_all()

    @property
    def refused(self) -> int:
        """Messages that were no triplets."""
        return self._stream.refused

    def next(self, timeout_s: float | None = None) -> Triplet | None:
        """The next triplet; None when none has come within `timeout_s` (None: for ever), or after `stop`."""
        deadline = None if timeout_s is None else time.monotonic() + timeout_s
        while not self._stopped:
            left_s = _LONG_S if deadline is None else deadline - time.monotonic()
            received = self._stream.next(max(0.0, left_s), self._wake)
            if received is not None:
                return self._triplet(received)
            if deadline is not None and time.monotonic() >= deadline:
                break
        return None

    def stop(self) -> None:
        """End the iteration, and a call of `next` that waits."""
        if not self._stopped:  # when it is closed, there is nothing to wake
            self._stopped = True
            os.eventfd_write(self._wake, 1)

    def close(self) -> None:
        """Close the connection; a second call does nothing."""
        self._stopped = True
        self._opened.close()

    def __iter__(self) -> Iterator[Triplet]:
        while (triplet := self.next(self._timeout_s)) is not None:
            yield triplet

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _triplet(self, received: Received) -> Triplet:
        tag, image = received.tag, received.image
        if self._last is not None and self._last[0] == tag.recording:
            self.missed += max(0, tag.pulse - self._last[1] - 1)
        self._last = tag.recording, tag.pulse
        frames = {
            camera.name: image[camera.part]
            for camera in tag.cameras
            if image is not None and camera.status is FrameStatus.OK
        }
        return Triplet(tag, frames, image)
