"""What the commands that read a log say of one that was cut off."""

from pathlib import Path

from rig.errors import LogTruncatedError


def truncated(log: Path) -> LogTruncatedError:
    """The error for a log that ends in the middle of a record; everything before it has been reported."""
    return LogTruncatedError(
        f"{log}: truncated: it ends in the middle of a record; copy it again from the machine that recorded it, "
        "or use what can be read"
    )
