"""Writes a jump as `jumper.c3d`, for programs of biomechanics.

Points in mm, Z up, with labels of `analysis.export.places`. Of each point the fourth word holds the cameras (high byte,
bit 0 = first camera of `SVEV:CAMERAS`) and the residual, the root mean square of its three sigmas in steps of 0.5 mm,
at most 127.5 mm (low byte); it is -1, with coordinates 0, where the point was not measured. ANALOG holds sigma X, Y, Z
of each point, mm; -1 where it was not measured. The word's sign means "not measured", so that an eighth camera has no
bit. Frame numbers are pulse numbers as far as the format can count them (65535), otherwise they begin with 1;
`SVEV:FIRST_PULSE` and `SVEV:TAKEOFF_PULSE` say which pulses. Coordinates are single-precision: if they lie far from
zero, `SVEV:ORIGIN` (m) has been subtracted. ezc3d reads and writes the two bytes of the word exchanged
(pyomeca/ezc3d#386).
"""

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import c3d
import numpy as np

from analysis.export.places import LABELS, SKI_LENGTH_M, Places, places
from analysis.result.model import Jump
from rig.arrays import Flags, Floats

STEP_MM: Final = 0.5  #: of the residual
_MOST_MM: Final = 255 * STEP_MM
_MASKED_CAMERAS: Final = 7
_LAST_FRAME: Final = 65_535
#: Single-precision coordinates are shifted where they would be coarser than 0.06 mm.
_FAR_M: Final = 1_000.0
_ORIGIN_STEP_M: Final = 100.0
_MM: Final = 1_000.0
_BLOCK: Final = 512


def write(jump: Jump, rate_hz: float, cameras: Sequence[str], path: Path, ski_length_m: float = SKI_LENGTH_M) -> None:
    """Write a jump that has pulses.

    Args:
        jump: to write.
        rate_hz: pulses per second.
        cameras: names in the order of the bits.
        path: of the file.
        ski_length_m: the jumper's.

    Raises:
        OSError: the disk refuses.
    """
    found = places(jump, ski_length_m)
    origin = _origin(found.xyz)
    writer = c3d.Writer(point_rate=rate_hz, analog_rate=rate_hz, point_scale=-STEP_MM, point_units="mm")
    _describe(writer, found, [name[:16] for name in cameras[:_MASKED_CAMERAS]])
    first = int(found.pulses[0])
    _state(writer, origin, first, None if jump.takeoff is None else jump.takeoff.pulse)
    writer.set_start_frame(first if first >= 1 and found.pulses[-1] <= _LAST_FRAME else 1)
    words = _words(found, cameras)
    there = words[..., 0] >= 0
    coordinates = np.where(there[..., None], (found.xyz - origin) * _MM, 0.0)
    sigmas = np.where(there[..., None], found.sigma * _MM, -1.0)
    for row in range(len(found.pulses)):
        writer.add_frames((np.hstack((coordinates[row], words[row])), sigmas[row].reshape(-1, 1)))
    buffer = io.BytesIO()
    writer.write(buffer)
    path.write_bytes(_cleared(buffer.getvalue(), there, 3 * len(found.labels)))


def _words(found: Places, cameras: Sequence[str]) -> Floats:
    """(n, k, 2) residual in mm, -1 where not measured, and the cameras as bits."""
    rms = np.sqrt((found.sigma**2).mean(axis=-1)) * _MM
    measured = np.isfinite(rms + found.xyz.sum(axis=-1))
    bit = {name: 1 << index for index, name in enumerate(cameras[:_MASKED_CAMERAS])}
    masks = [[sum(bit.get(name, 0) for name in seen) for seen in row] for row in found.cameras]
    return np.stack((np.where(measured, np.minimum(rms, _MOST_MM), -1.0), np.array(masks, float)), axis=-1)


def _origin(xyz: Floats) -> Floats:
    """(3,) m, what has to be subtracted; zero near the origin of the survey."""
    if not np.isfinite(xyz).any() or np.nanmax(np.abs(xyz)) < _FAR_M:
        return np.zeros(3)
    middle = np.nanmedian(xyz.reshape(-1, 3), axis=0)
    return np.asarray(_ORIGIN_STEP_M * np.round(middle / _ORIGIN_STEP_M))


def _describe(writer: Any, found: Places, cameras: list[str]) -> None:
    writer.set_point_labels(found.labels)
    writer.set_screen_axis("+X", "+Z")
    raw, smoothed = "of this pulse alone", "from the model over time"
    _texts(writer.point_group, "DESCRIPTIONS", [raw] * len(LABELS) + [smoothed] * len(LABELS))
    channels = [f"{label} sigma {axis}" for label in found.labels for axis in "XYZ"]
    writer.set_analog_labels(channels)
    writer.set_analog_scales([1.0] * len(channels))
    writer.set_analog_offsets([0] * len(channels))
    _texts(writer.analog_group, "DESCRIPTIONS", ["standard deviation"] * len(channels))
    _texts(writer.analog_group, "UNITS", ["mm"] * len(channels))
    _texts(writer.get_create("SVEV"), "CAMERAS", cameras or [" "])


def _state(writer: Any, origin: Floats, first_pulse: int, takeoff_pulse: float | None) -> None:
    group = writer.get_create("SVEV")
    group.add_array("ORIGIN", "Subtracted from the coordinates, m", origin.astype(np.float32))
    group.add_array("FIRST_PULSE", "Pulse of the first frame", np.array([first_pulse], np.float32))
    if takeoff_pulse is not None:
        group.add_array("TAKEOFF_PULSE", "O passes the edge", np.array([takeoff_pulse], np.float32))


def _texts(group: Any, name: str, texts: Sequence[str]) -> None:
    packed, size = c3d.Writer.pack_labels(texts)
    group.add_str(name, name.capitalize(), packed, size, len(texts))


def _cleared(content: bytes, there: Flags, channels: int) -> bytes:
    """The file with coordinates 0 where nothing was measured; the library repeats those of the frame before."""
    frames, points = there.shape
    start = (int.from_bytes(content[16:18], "little") - 1) * _BLOCK
    changed = bytearray(content)
    data = np.frombuffer(changed, "<f4", frames * (4 * points + channels), start).reshape(frames, -1)
    data[:, : 4 * points].reshape(frames, points, 4)[~there, :3] = 0.0
    return bytes(changed)
