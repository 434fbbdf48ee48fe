"""Which files of a result say whose jump it is, and what they are written from when that was corrected."""

from typing import Final

#: Name of the file with the oriented cameras in a folder of results.
CAMERAS: Final = "cameras.json"


def bears_names(name: str) -> bool:
    """Whether a file, by its name, says whose jump it is: the coach's page, the kinogram, `jumper.json`."""
    return name in {"report.html", "jumper.json"} or name.startswith("kinogram")
