"""Writes a jump as `jumper.trc`, for OpenSim and its relatives.

Tabs, metres, Y up: X of the file is X of the survey, Y is its Z, Z is its -Y. Points are those of
`analysis.export.places`; a point that was not measured leaves its three cells empty. Every pulse has a row with its
number and its time since the first one.
"""

from pathlib import Path
from typing import Final

import numpy as np

from analysis.export.places import SKI_LENGTH_M, places
from analysis.result.model import Jump
from rig.arrays import Floats

_HEAD: Final = (
    *("DataRate", "CameraRate", "NumFrames", "NumMarkers", "Units"),
    *("OrigDataRate", "OrigDataStartFrame", "OrigNumFrames"),
)
#: Axes of the file in those of the survey, as rows.
_TURN: Final = np.array(((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0)))


def write(jump: Jump, rate_hz: float, path: Path, ski_length_m: float = SKI_LENGTH_M) -> None:
    """Write a jump that has pulses.

    Raises:
        OSError: the disk refuses.
    """
    found = places(jump, ski_length_m)
    count, first = len(found.pulses), int(found.pulses[0])
    values = (f"{rate_hz:g}", f"{rate_hz:g}", count, len(found.labels), "m", f"{rate_hz:g}", first, count)
    axes = [f"{axis}{number}" for number in range(1, len(found.labels) + 1) for axis in "XYZ"]
    lines = [
        f"PathFileType\t4\t(X/Y/Z)\t{path.name}",
        "\t".join(_HEAD),
        "\t".join(str(value) for value in values),
        "\t".join(("Frame#", "Time", *(cell for label in found.labels for cell in (label, "", "")))),
        "\t".join(("", "", *axes)),
        "",
    ]
    for pulse, xyz in zip(found.pulses, found.xyz @ _TURN.T, strict=True):
        lines.append("\t".join((str(pulse), f"{(pulse - first) / rate_hz:.6f}", *_cells(xyz))))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")


def _cells(xyz: Floats) -> list[str]:
    return ["" if np.isnan(value) else f"{value:.5f}" for value in xyz.ravel()]
