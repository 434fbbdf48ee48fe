"""Where the truth of a log stands, if its cameras were simulated. The recorder neither writes nor reads it."""

from pathlib import Path


def truth_path(log: Path) -> Path:
    """Path of the file with the truth of a log."""
    return log.with_suffix(".truth.json")
