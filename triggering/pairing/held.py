"""Keeps the frames whose trigger times cannot be judged yet, in each camera's order.

Their pixels stay in the cameras' rings meanwhile. Damaged arrivals behind them wait too, so that the order stays.
"""

from collections import deque
from collections.abc import Iterator
from typing import Final, NamedTuple

from rig.clocks import NS_PER_S, HostNs
from rig.frame import DamagedRecord, FrameRecord
from triggering.pairing.outcomes import OpenPulse

#: The clock is read right after a frame that comes out of turn, and four times a second. If the camera does not answer
#: for this long, its clock is not known.
_LONGEST_NS: Final = NS_PER_S


class Released(NamedTuple):
    """A frame that was held, and its pulse; None: it belongs to none."""

    camera: int
    record: FrameRecord
    pulse: OpenPulse | None


class HeldFrames:
    """The waiting frames, and the released ones.

    Args:
        cameras: how many cameras there are.
    """

    def __init__(self, cameras: int) -> None:
        self._queues: list[deque[FrameRecord | DamagedRecord]] = [deque() for _ in range(cameras)]
        self._released: list[Released] = []
        self.count = 0

    def hold(self, camera: int, record: FrameRecord | DamagedRecord) -> None:
        """Let a frame wait behind its camera's other waiting frames."""
        self._queues[camera].append(record)
        self.count += 1

    def any_of(self, camera: int) -> bool:
        """Whether a frame of a camera waits."""
        return bool(self._queues[camera])

    def frames(self, camera: int) -> list[FrameRecord]:
        """The whole frames of a camera that wait, in order."""
        return [record for record in self._queues[camera] if isinstance(record, FrameRecord)]

    def ended(self, now: HostNs) -> list[int]:
        """The cameras whose frames have waited for as long as they may."""
        return [camera for camera, end in self._ends() if now >= end]

    def last_end(self, pulse: OpenPulse, arrived: HostNs) -> HostNs:
        """Until when waiting frames may still be accepted for a pulse without them.

        Args:
            pulse: an open one.
            arrived: its frames have come by then. Frames that have come later do not keep it waiting, since a doubted
                camera always has a frame that waits.
        """
        lacking = (
            end for camera, end in self._ends()
            if pulse.frames[camera] is None and self._queues[camera][0].host_time <= arrived
        )  # fmt: skip
        return max(lacking, default=HostNs(0))

    def _ends(self) -> Iterator[tuple[int, HostNs]]:
        for camera, queue in enumerate(self._queues):
            if queue:
                yield camera, HostNs(queue[0].host_time + _LONGEST_NS)

    def has(self, camera: int, record: FrameRecord) -> bool:
        """Whether a frame is the last one of its camera that waits, or has waited and `released` will return it."""
        queue = self._queues[camera]
        return (bool(queue) and queue[-1] is record) or any(each.record is record for each in self._released)

    def next_end(self) -> HostNs | None:
        """When the first of all has waited for as long as it may; None: none waits."""
        return min((end for _, end in self._ends()), default=None)

    def take(self, camera: int) -> FrameRecord | DamagedRecord:
        """Take a camera's first frame out."""
        self.count -= 1
        return self._queues[camera].popleft()

    def take_damaged(self, camera: int) -> DamagedRecord | None:
        """Take a camera's first frame out if it is damaged."""
        queue = self._queues[camera]
        if queue and isinstance(first := queue[0], DamagedRecord):
            self.take(camera)
            return first
        return None

    def release(self, camera: int, record: FrameRecord, pulse: OpenPulse | None) -> None:
        """Note the pulse of a frame that was taken out."""
        self._released.append(Released(camera, record, pulse))

    def released(self) -> list[Released]:
        """The frames that have been released since the last call."""
        released = self._released
        if released:
            self._released = []
        return released
