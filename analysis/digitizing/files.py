"""Which files a log that is measured by hand has. Light: the panel imports it before anybody measures."""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class DeskFiles:
    """The files of a log that is measured by hand.

    Attributes:
        log: the log.
        folder: for what is measured by hand; made when the first operator begins.
        measured: where the automatic measurement of this log lies, if there is one.
        landmarks: file with further landmarks; None: `landmarks.toml` beside the log, if there is one.
    """

    log: Path
    folder: Path
    measured: Path
    landmarks: Path | None = None
