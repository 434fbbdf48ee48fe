"""Where the survey of a log stands, if its cameras were simulated. The recorder neither writes nor reads it."""

from pathlib import Path


def survey_path(log: Path) -> Path:
    """Path of the file with the survey of the balls and the interior orientations, as `svev analyze` takes it."""
    return log.with_suffix(".survey.json")
