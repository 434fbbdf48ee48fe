"""How far two frames of one camera are apart by the camera's own count.

GigE Vision counts the frames that a camera took (block id): 16-bit ids run 1..65535 and skip 0, 64-bit ids and
IIDC frame counters never wrap in practice. A frame lost in transfer leaves a hole in the ids, a pulse that the
camera did not see leaves none.
"""


def id_step(previous: int, current: int, modulus: int) -> int:
    """Number of frames that the camera took from `previous` (excluded) to `current` (included).

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
