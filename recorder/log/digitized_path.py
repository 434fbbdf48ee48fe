"""Where stands what people measured in a log by hand. The recorder neither writes nor reads it."""

from pathlib import Path


def digitized_path(log: Path) -> Path:
    """Path of the folder with the marks of all operators."""
    return log.with_suffix(".digitized")
