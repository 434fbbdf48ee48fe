"""The folder of the recordings: path of a new log, how much more fits on the disk, and what makes room there."""

import os
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from recorder.catalogue.trash import trash_contents
from rig.errors import BadInputError, StorageError
from rig.host.disk import free_bytes
from rig.phrase import Phrase, phrase
from rig.settings.model import RigSettings


def new_log_path(directory: Path) -> Path:
    """A path for a new log, named by the present time (UTC), in `directory`, which is made if missing.

    Raises:
        BadInputError: the directory cannot be made or written.
    """
    name = datetime.now(UTC).strftime("%Y-%m-%dT%H-%M-%SZ")
    try:
        directory.mkdir(parents=True, exist_ok=True)
        probe = directory / f".{name}.probe"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise BadInputError(
            f"{directory}: cannot be written ({error.strerror}); choose another --out or correct its permissions"
        ) from None
    return free_path(directory / f"{name}.mcap")


def free_path(path: Path) -> Path:
    """The path, or if there is something of this name, with the first number behind its name that is free."""
    free, again = path, 1
    while os.path.lexists(free):
        again += 1
        free = path.with_name(f"{path.stem}-{again}{path.suffix}")
    return free


_GB: Final = 1e9


@dataclass(frozen=True, slots=True)
class Room:
    """How much can still be recorded.

    Attributes:
        free_bytes: free bytes on the disk.
        seconds: length of recording until only the reserve is left, whole seconds.
        jumps: number of jumps of `recorder.jump_s` that fit into it.
    """

    free_bytes: int
    seconds: float
    jumps: int


def usable_bytes(rig: RigSettings, free_bytes: int) -> float:
    """Bytes that recordings may take: the free ones without the reserve; negative if less than the reserve is free."""
    return free_bytes - rig.recorder.reserve_gb * _GB


def bytes_per_s(rig: RigSettings) -> float:
    """Bytes per second of a recording when all cameras deliver at the rig's rate."""
    return rig.triplet_bytes * rig.trigger.rate_hz


def room_for(rig: RigSettings, free_bytes: int, trash_bytes: int = 0) -> Room:
    """How much can be recorded.

    Args:
        rig: the rig.
        free_bytes: free on the disk.
        trash_bytes: what the trash holds, if it makes room when room runs short.
    """
    seconds = max(0.0, usable_bytes(rig, free_bytes + trash_bytes)) // bytes_per_s(rig)
    return Room(free_bytes, seconds, int(seconds / rig.recorder.jump_s))


def check_room_for(rig: RigSettings, directory: Path, seconds: float) -> None:
    """Check that a recording of `seconds` fits on the disk.

    Raises:
        StorageError: it does not fit; the message says what makes room.
    """
    free = free_bytes(directory) or 0
    room = room_for(rig, free)
    if room.seconds < seconds:
        missing = seconds * bytes_per_s(rig) - usable_bytes(rig, free)
        text = (
            "{folder}: there is room for {room:.0f} s and {wanted:g} s are wanted, beside the reserve of "
            "{reserve_gb:g} GB: {remedy}"
        )
        remedy, reserve_gb = _what_makes_room(directory, missing), rig.recorder.reserve_gb
        raise StorageError(
            phrase(
                "why_no_room", text,
                folder=str(directory), room=room.seconds, wanted=seconds, reserve_gb=reserve_gb, remedy=remedy,
            )
        )  # fmt: skip


def _what_makes_room(directory: Path, missing_bytes: float) -> Phrase:
    """What to do for so much more room. Deleting alone gives none: what is deleted lies in the trash."""
    trash = trash_contents(directory).bytes
    if trash >= missing_bytes:
        return phrase("room_by_trash", "empty the trash, which frees {gb:.1f} GB", gb=trash / _GB)
    if trash:
        text = "empty the trash, which frees {gb:.1f} GB, then delete recordings and empty it again"
        return phrase("room_by_trash_and_more", text, gb=trash / _GB)
    return phrase("room_by_deleting", "delete recordings and then empty the trash, or move recordings to another disk")
