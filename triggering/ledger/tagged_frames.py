"""Evidence from two whole frames of a camera, as their tags describe them, about the pulses between them."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from rig.clocks import UtcNs
from rig.frame import FrameStatus
from rig.pulse import PulseNumber
from rig.tag import CameraTag, TripletTag

#: 16-bit block ids run from 1 to this and skip 0.
_IDS_16_BIT: Final = 65535
#: Frame numbers and trigger counts have 64 bits.
_COUNT_MAX: Final = 1 << 64


@dataclass(frozen=True, slots=True)
class TaggedFrame:
    """A whole frame as its tag describes it; times in ns."""

    pulse: PulseNumber
    time: UtcNs
    frame_id: int
    triggers: int | None
    device: int
    host: int

    @property
    def late(self) -> int:
        """Time from the pulse to the arrival of the frame, ns."""
        return self.host - self.time


def frame_of(tag: TripletTag, part: CameraTag) -> TaggedFrame | None:
    """The frame of a camera's part of a tag; None if a field is missing or impossible."""
    if part.frame_id is None or part.device_time is None or part.host_time is None:
        return None
    if max(abs(part.frame_id), abs(part.trigger_count or 0)) > _COUNT_MAX:
        return None
    return TaggedFrame(tag.pulse, tag.time, part.frame_id, part.trigger_count, part.device_time, part.host_time)


def goes_on(last: TaggedFrame | None, frame: TaggedFrame, steps: int) -> bool:
    """Whether numbers and triggers of a frame go on from the last one as the pulses do."""
    if last is None or id_step(last.frame_id, frame.frame_id) != steps:
        return False
    return last.triggers is None or frame.triggers is None or frame.triggers - last.triggers == steps


def is_of_another_pulse(last: TaggedFrame, frame: TaggedFrame, by_clock: float, nearest: int, *, certain: bool) -> bool:
    """Whether a frame is filed under a wrong pulse: clock and frame number agree on another one.

    If the number contradicts the clock, the clock was set. A camera that missed a pulse while its clock was set back by
    just one period looks alike, and so do all cameras where a pulse between has no tag; there, the arrival decides.
    `certain`: no pulse between the two is tagged as missing.
    """
    step, pulses = id_step(last.frame_id, frame.frame_id), frame.pulse - last.pulse
    if abs(by_clock - step * nearest) >= nearest / 2:
        return False
    untagged = frame.time - last.time > (pulses + 0.5) * nearest
    if not untagged and (certain or step > pulses):
        return True
    return abs(by_clock - (frame.host - last.host)) < nearest / 2


def recomputed(
    tagged: tuple[tuple[PulseNumber, FrameStatus], ...], taken: int, untagged: int
) -> Iterator[tuple[PulseNumber, FrameStatus, FrameStatus]]:
    """Pulse, tagged and recomputed state in a gap in which the camera took `taken` frames.

    The numbers tell how many, not at which pulses; as many tags as possible are left as they are. `untagged` pulses of
    the gap have no tag: any of them may have had one of the frames.
    """
    is_taken = {FrameStatus.LOST, FrameStatus.DAMAGED}
    claimed = sum(status in is_taken for _, status in tagged)
    too_few, too_many = max(0, taken - untagged - claimed), max(0, claimed - taken)
    # Damage was seen to arrive; "lost" was concluded, and so it is revised first.
    spare = sum(status is FrameStatus.LOST for _, status in tagged)
    for pulse, status in tagged:
        found = status
        if status in is_taken and too_many > 0 and (status is FrameStatus.LOST or too_many > spare):
            found, too_many = FrameStatus.MISSED, too_many - 1
        elif status not in is_taken:
            found = FrameStatus.LOST if too_few > 0 else FrameStatus.MISSED
            too_few -= found is FrameStatus.LOST
        spare -= status is FrameStatus.LOST
        yield pulse, status, found


def id_step(before: int, after: int) -> int:
    """Frames taken from one frame number to another; a log does not say whether numbers wrap, but they do at 65535."""
    step = after - before
    wraps = step < 0 and before <= _IDS_16_BIT and step < -_IDS_16_BIT // 2
    return step + _IDS_16_BIT if wraps else step
