"""A trigger pulse: open while its frames come in, then closed, with what became of it in every camera."""

from collections.abc import Mapping
from typing import Final

import msgspec

from rig.clocks import HostNs
from rig.frame import FrameRecord, FrameStatus
from rig.pulse import RigPulse


class OpenPulse:
    """A pulse that some camera saw and that is not decided yet.

    Attributes:
        cargo: for the caller's use, e.g. where it composes the triplet; handed on to the `ClosedPulse`.
        time: time of the pulse on the common time line: median of its frames' trigger times.
        frames: one per camera, None where no whole frame has come.
        times: the frames' trigger times, likewise.
        missing: how many frames have not come.
        delivered: the cameras whose frames have come, one bit each.
        proven_by_ids: no camera delivered a frame, but the frame ids prove that the pulse fired.
        unwatched: no camera was there; the rhythm of the train tells that the pulse was due.
        fired: no camera delivered a frame, but the source says that it fired the pulse.
    """

    __slots__ = ("cargo", "delivered", "fired", "frames", "missing", "proven_by_ids", "time", "times", "unwatched")

    def __init__(
        self,
        cameras: int,
        time: HostNs,
        *,
        proven_by_ids: bool = False,
        unwatched: bool = False,
        fired: bool = False,
    ) -> None:
        self.cargo: object | None = None
        self.time = time
        self.frames: list[FrameRecord | None] = [None] * cameras
        self.times: list[HostNs | None] = [None] * cameras
        self.missing = cameras
        self.delivered = 0
        self.proven_by_ids = proven_by_ids
        self.unwatched = unwatched
        self.fired = fired

    def add(self, camera: int, record: FrameRecord, time: HostNs) -> None:
        """Add a camera's frame, triggered at `time`."""
        self.frames[camera] = record
        self.times[camera] = time
        self.missing -= 1
        self.delivered |= 1 << camera
        if self.missing == len(self.times) - 1:
            self.time = time
            return
        times = sorted([known for known in self.times if known is not None])
        middle = len(times) // 2
        self.time = times[middle] if len(times) % 2 else HostNs((times[middle - 1] + times[middle]) // 2)

    @property
    def spread_ns(self) -> int:
        """Latest minus earliest trigger time, 0 if fewer than two frames came."""
        times = [time for time in self.times if time is not None]
        return max(times) - min(times) if times else 0


class Outcome(msgspec.Struct, frozen=True):
    """What became of a pulse in one camera.

    Attributes:
        record: the frame, None unless `status` is ok.
        offset_ns: the frame's trigger time minus the pulse's, both on the common time line; None likewise.
        overrun: the camera saw the pulse but missed it, because it was still busy with the frame before.
    """

    status: FrameStatus
    record: FrameRecord | None = None
    offset_ns: int | None = None
    overrun: bool = False


NO_FRAME: Final[Mapping[FrameStatus, Outcome]] = {status: Outcome(status) for status in FrameStatus}
OVERRUN: Final = Outcome(FrameStatus.MISSED, overrun=True)


class ClosedPulse(msgspec.Struct, frozen=True):
    """A decided pulse.

    Attributes:
        number: counted from 1 in the order of time, without gaps.
        time: time of the pulse on the common time line.
        outcomes: one per camera.
        cargo: the cargo of the `OpenPulse`; None if no frame came.
        unwatched: no camera was there; the rhythm of the train tells that the pulse was due.
    """

    number: RigPulse
    time: HostNs
    outcomes: tuple[Outcome, ...]
    cargo: object | None
    unwatched: bool = False

    @property
    def complete(self) -> bool:
        """Whether every camera delivered its frame."""
        return all(outcome.status is FrameStatus.OK for outcome in self.outcomes)
