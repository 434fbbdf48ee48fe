"""Parts of the frame path on their own, each beside what the machine can do at best."""

import time
import zlib
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from isal.isal_zlib import crc32
from numpy.typing import NDArray

from recorder.live.unpacking import Unpack, unpacker
from rig.images.pixels import Stored
from rig.settings.camera import CameraSettings, Region

_SHAPE = (1216, 1936)
_FRAMES = 24  # more than fits into the cache: memory is read cold, as in a ring


def run_parts(seconds: float) -> list[dict[str, Any]]:
    """Compose, unpack and checksum triplets of three 1936 x 1216 frames, each part for a fraction of `seconds`.

    Returns:
        Cases with name, value, unit, baseline and what the baseline is.
    """
    budget = min(2.0, seconds / 8)
    rows, columns = _SHAPE
    frames = np.random.default_rng(1).integers(0, 255, (_FRAMES, rows, columns), np.uint8)
    triplets = np.zeros((_FRAMES // 3, rows, 3 * columns), np.uint8)
    flat = np.zeros_like(frames)
    size = rows * columns / 1e9

    def compose(i: int) -> None:
        camera = i % 3
        np.copyto(triplets[i // 3 % len(triplets), :, camera * columns : (camera + 1) * columns], frames[i % _FRAMES])

    def copy(i: int) -> None:
        np.copyto(flat[i % _FRAMES], frames[(i + 1) % _FRAMES])

    def ours_crc(i: int) -> None:
        crc32(frames[i % _FRAMES])

    def zlib_crc(i: int) -> None:
        zlib.crc32(frames[i % _FRAMES])

    return [
        _case("compose, GB/s", size, compose, copy, "plain copy of a frame", budget),
        *(_unpacking(name, budget) for name in ("Mono12", "Mono12p", "Mono12Packed", "Mono10p", "Mono10Packed")),
        _case("checksum, GB/s", size, ours_crc, zlib_crc, "zlib", budget),
    ]


def _unpacking(name: str, budget: float) -> dict[str, Any]:
    """Frames of one pixel format that become triplets of 16 bits, beside frames of 8 bits that are only copied."""
    rows, columns = _SHAPE
    region = Region(width=columns, height=rows)
    work = []
    for pixel_format in (name, "Mono8"):
        fields = {"name": "K1", "backend": "aravis", "address": "-", "pixel_format": pixel_format, "region": region}
        camera = CameraSettings.model_validate(fields)
        frames = np.random.default_rng(1).integers(0, 255, (_FRAMES, camera.frame_bytes), np.uint8)
        triplets = np.zeros((_FRAMES // 3, rows, 3 * columns), camera.format.pixels.dtype)
        work.append(partial(_unpack, unpacker(camera), frames, triplets))
    return _case(f"unpack {name}, Mpixel/s", rows * columns / 1e6, work[0], work[1], "Mono8", budget)


def _unpack(unpack: Unpack, frames: NDArray[np.uint8], triplets: Stored, i: int) -> None:
    columns = triplets.shape[2] // 3
    first = i % 3 * columns
    unpack(frames[i % _FRAMES], triplets[i // 3 % len(triplets), :, first : first + columns])


def _case(
    name: str,
    amount: float,
    ours: Callable[[int], Any],
    theirs: Callable[[int], Any],
    what: str,
    budget: float,
) -> dict[str, Any]:
    """Amount per second of both, taken in turns so that the machine's moods hit both."""
    rates: tuple[list[float], list[float]] = ([], [])
    end = time.perf_counter() + budget
    i = 0
    while time.perf_counter() < end:
        for kept, work in zip(rates, (ours, theirs), strict=True):
            before = time.perf_counter()
            for step in range(i, i + 12):
                work(step)
            kept.append(12 * amount / (time.perf_counter() - before))
        i += 12
    value, baseline = (float(np.median(kept)) for kept in rates)
    return {"name": name, "value": round(value, 3), "baseline": round(baseline, 3), "baseline_is": what}
