"""What the ids and the trigger counts of two frames of a camera say of what came between them."""

from rig.frame import FrameRecord


def overruns_between(last: FrameRecord, record: FrameRecord, frames: int) -> int:
    """Triggers between two whole frames at which the camera took no frame, when it took `frames` in all."""
    if record.trigger_count < 0 or last.trigger_count < 0:
        return 0
    return max(0, record.trigger_count - last.trigger_count - frames)


def id_step(previous: int, current: int, modulus: int) -> int:
    """Number of frames that the camera took from `previous` (excluded) to `current` (included).

    GigE Vision counts the frames that a camera took (block id): 16-bit ids run 1..65535 and skip 0; 64-bit ids and the
    frame counters of IIDC cameras never wrap in practice. A frame lost in transfer leaves a hole in the ids, a pulse
    that the camera did not see leaves none.

    Args:
        previous: id of the earlier frame.
        current: id of the later frame.
        modulus: how many different ids there are (65535 for 16-bit block ids), 0 if they never wrap.

    Returns:
        1 for neighbours, 0 for the same id, negative if the ids went back. Ids that wrap are taken the short way
        round, so a step is at most half the modulus either way.
    """
    step = current - previous
    if modulus == 0:
        return step
    step %= modulus
    return step - modulus if step > modulus // 2 else step
