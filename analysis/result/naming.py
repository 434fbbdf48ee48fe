"""Which files of a result name the jumper, and from what they are written when his name was corrected."""

from typing import Final

#: Name of the file with the oriented cameras in a folder of results.
CAMERAS: Final = "cameras.json"


def bears_names(name: str) -> bool:
    """Whether a file, by its name, says whose jump it is: the coach's page, the kinogram, `jumper.json`."""
    return name in {"report.html", "jumper.json"} or name.startswith("kinogram")
