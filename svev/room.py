"""Room on the disk, in bytes, seconds and jumps."""

import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from rig.errors import StorageError
from rig.settings import RigSettings

_GB: Final = 1e9


@dataclass(frozen=True, slots=True)
class Room:
    """How much can still be recorded.

    Attributes:
        free_bytes: free on the disk.
        seconds: so long until only the reserve is left, whole seconds.
        jumps: so many jumps of `recorder.jump_s`.
    """

    free_bytes: int
    seconds: float
    jumps: int


def usable_bytes(rig: RigSettings, free_bytes: int) -> float:
    """What may be recorded into free bytes beside the reserve; less than 0 if that is short already."""
    return free_bytes - rig.recorder.reserve_gb * _GB


def bytes_per_s(rig: RigSettings) -> float:
    """What a recording takes, all cameras delivering at the rig's rate."""
    rows, columns = rig.triplet_shape
    return rows * columns * rig.trigger.rate_hz


def room_for(rig: RigSettings, free_bytes: int) -> Room:
    """What fits into free bytes."""
    seconds = max(0.0, usable_bytes(rig, free_bytes)) // bytes_per_s(rig)
    return Room(free_bytes, seconds, int(seconds / rig.recorder.jump_s))


def free_bytes(directory: Path) -> int:
    """Free on the disk of a directory; nothing while it is not there (an unplugged disk, say)."""
    try:
        return shutil.disk_usage(directory).free
    except OSError:
        return 0


def check_room_for(rig: RigSettings, directory: Path, seconds: float) -> None:
    """Whether a recording fits.

    Raises:
        StorageError: it does not.
    """
    room = room_for(rig, free_bytes(directory))
    if room.seconds < seconds:
        raise StorageError(
            f"{directory}: there is room for {room.seconds:.0f} s and {seconds:g} s are wanted, beside the reserve of "
            f"{rig.recorder.reserve_gb:g} GB: delete recordings, or copy them away"
        )
