"""The table of makers in docs/reference/cameras.md: the features by which each camera is set up, asked of it.

`python -m tests.capture.aravis.makers_table` writes it anew. With `SVEV_GENICAM_DIR` it prints a row for each
description (`*.xml`) in that folder as well.
"""

import os
import re
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from capture.aravis.camera import _TEMPERATURES, AravisCamera
from capture.aravis.configuration import _FASTEST
from capture.aravis.features import Features
from rig.errors import CameraError
from simrig.gige.registers.makers import Maker
from tests.capture.aravis.described import described, descriptions
from tests.capture.aravis.test_makers import make
from tests.support.loopback import Loopback

PAGE: Final = Path(__file__).parents[3] / "docs" / "reference" / "cameras.md"
BEGIN, END = "<!-- made by tests/capture/aravis/makers_table.py -->\n", "<!-- end -->\n"
_HEAD: Final = (
    "camera", "source", "trigger", "exposure", "gain", "rate", "actions", "PTP", "temperature", "bandwidth",
)  # fmt: skip
_NONE: Final = "none"
#: Range of the GevSCPD that Aravis adds to descriptions without one.
_ADDED_DELAY: Final = (0, 1000, 1)


def table(rows: list[tuple[str, ...]]) -> str:
    """Rows as Markdown."""
    lines = [_HEAD, ("---",) * len(_HEAD), *rows]
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def simulated(loopback: Loopback) -> Iterator[tuple[str, ...]]:
    """A row for each dialect of the simulated camera."""
    for maker in Maker:
        with (
            tempfile.TemporaryDirectory() as folder,
            make(maker, Path(folder), loopback) as made,
            made.opened() as camera,
        ):
            yield (maker.value, "simulator", *_row(camera))


def from_descriptions(folder: Path, loopback: Loopback) -> Iterator[tuple[str, ...]]:
    """A row for each description in a folder, or why the camera would be refused."""
    for path in descriptions(folder):
        with tempfile.TemporaryDirectory() as place:
            try:
                with described(path, Path(place), loopback) as made, made.opened() as camera:
                    yield (path.stem, "description", *_row(camera))
            except CameraError as error:
                yield (path.stem, "description", f"refused: {error}", *[_NONE] * (len(_HEAD) - 3))


def _row(camera: AravisCamera) -> tuple[str, ...]:
    features = camera._features
    source = "TriggerSource" if features.has("TriggerMode") else "LineSource"
    by = features.chosen("TriggerSelector") if features.has("TriggerMode") else features.chosen("ExposureMode")
    return (
        f"{by or 'its only one'}, {features.chosen(source) or 'its only input'}",
        features.first_number("ExposureTime", "ExposureTimeAbs", "Exposure", "ExposureTimeRaw") or _NONE,
        features.first_number("Gain", "GainAbs", "GainRaw") or _NONE,
        features.first_number(*_FASTEST) or _NONE,
        ", ".join(each for each in features.entries(source) if re.fullmatch(r"Action\d+", each)) or _NONE,
        _first(features, "PtpEnable", "GevIEEE1588", "PtpMode"),
        features.first_number(*_TEMPERATURES) or _NONE,
        _bandwidth(features),
    )


def _bandwidth(features: Features) -> str:
    """What sets the time between packets."""
    if features.bounds("GevSCPD") != _ADDED_DELAY:
        return "GevSCPD"
    limit = _first(features, "StreamBytesPerSecond", "DeviceLinkThroughputLimit")
    return "register of the standard" if limit == _NONE else limit


def _first(features: Features, *names: str) -> str:
    return next((name for name in names if features.has(name)), _NONE)


def main() -> None:
    """Write the table of the simulated cameras into the page, and print the rows of descriptions."""
    loopback = Loopback("127.77.7")  # far from those of tests
    text = PAGE.read_text(encoding="utf-8")
    before, rest = text.split(BEGIN)
    PAGE.write_text(before + BEGIN + table(list(simulated(loopback))) + END + rest.split(END)[1], encoding="utf-8")
    if folder := os.environ.get("SVEV_GENICAM_DIR"):
        sys.stdout.write(table(list(from_descriptions(Path(folder), loopback))))


if __name__ == "__main__":
    main()
