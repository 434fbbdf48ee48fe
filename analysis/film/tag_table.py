"""Writes what became of each pulse in each camera as a table (CSV): one row a pulse, also of those without a tag."""

import csv
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

from analysis.film.shots import UNKNOWN, Recording
from rig.clocks import NS_PER_S
from rig.tag import CameraTag

_FIELDS = ("status", "frame_id", "trigger_count", "device_time_ns", "host_time_ns", "offset_us")
Cell = str | int | float


def write_tag_table(recording: Recording, path: Path) -> None:
    """Write the table; the time of a pulse without a tag is empty, its statuses are "missing".

    Raises:
        OSError: the disk refuses.
    """
    with path.open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file)
        table.writerow(["pulse", "time_utc_ns", "time_utc", "complete", *_names(recording)])
        for pulse in recording.pulses:
            table.writerow(_row(recording, pulse))


def _names(recording: Recording) -> Iterator[str]:
    return (f"{camera}_{field}" for camera in recording.cameras for field in _FIELDS)


def _row(recording: Recording, pulse: int) -> list[Cell]:
    tag = recording.tag(pulse)
    if tag is None:
        return [pulse, "", "", "false", *(len(recording.cameras) * [UNKNOWN, *[""] * (len(_FIELDS) - 1)])]
    seconds = datetime.fromtimestamp(tag.time // NS_PER_S, UTC).strftime("%Y-%m-%dT%H:%M:%S")
    row: list[Cell] = [pulse, int(tag.time), f"{seconds}.{tag.time % NS_PER_S:09d}Z", str(tag.complete).lower()]
    there = {camera.name: camera for camera in tag.cameras}
    for name in recording.cameras:
        row += _cells(there.get(name))
    return row


def _cells(camera: CameraTag | None) -> list[Cell]:
    if camera is None:
        return [UNKNOWN, *[""] * (len(_FIELDS) - 1)]
    numbers = (camera.frame_id, camera.trigger_count, camera.device_time, camera.host_time, camera.offset_us)
    return [camera.status.value, *("" if number is None else number for number in numbers)]
