"""Where stands what was measured in a log when it was closed. The recorder neither writes nor reads it."""

from pathlib import Path


def measured_path(log: Path) -> Path:
    """Path of the folder with the results of a log."""
    return log.with_suffix(".measured")
