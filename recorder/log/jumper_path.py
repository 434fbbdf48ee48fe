"""Where the jumps of a log stand that were measured live. The recorder neither writes nor reads them."""

from pathlib import Path


def jumper_path(log: Path) -> Path:
    """Path of the file with the jumps of a log."""
    return log.with_suffix(".jumper.json")
