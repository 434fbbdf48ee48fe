"""What a log says of films that it was made of: that no trigger stands behind it, above all."""

import json
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path

from recorder.importing.films import Camera
from rig.clocks import NS_PER_S, UtcNs
from rig.images.pixels import FORMATS, Pixels

#: Pulse times of films of an unknown date begin with it.
EPOCH: UtcNs = UtcNs(0)


def rig_toml(log: Path, rate_hz: float, cameras: Sequence[Camera], pixels: Pixels) -> bytes:
    """A rig file for a log of films without one: it replays the log, and says what is known of the cameras.

    Args:
        log: the log.
        rate_hz: frames per second.
        cameras: left to right.
        pixels: how the log holds pixels.
    """
    names = [name for name, each in FORMATS.items() if each.pixels == pixels and each.group == 1]
    lines = [
        "# Made by svev import: the cameras of these films are not known. Replay is the only use of this rig.",
        'name = "imported films"',
        "",
        "[trigger]",
        f"rate_hz = {rate_hz!r}",
    ]
    for camera in cameras:
        width, height = camera.film.size
        lines += [
            "",
            "[[cameras]]",
            f'name = "{camera.name}"',
            'backend = "replay"',
            f"address = {json.dumps(str(log), ensure_ascii=False)}",
            f"region = {{ width = {width}, height = {height} }}",
            *(f'pixel_format = "{each}"' for each in names[:1]),
        ]
    return ("\n".join(lines) + "\n").encode("utf-8", "replace")


def date_in_words(date: UtcNs | None, by: str) -> str:
    """From where the pulse times of a log are taken.

    Args:
        date: of the first pulse, UTC; None: it is not known.
        by: who says so.
    """
    if date is None:
        return "unknown: pulse times count from 1970-01-01 00:00:00 UTC"
    return f"{datetime.fromtimestamp(date / NS_PER_S, UTC):%Y-%m-%d %H:%M:%S} UTC by {by}"


def provenance(
    cameras: Sequence[Camera], starts: Mapping[str, int], used: Mapping[str, int], common: Mapping[str, str]
) -> dict[str, str]:
    """The fields of the record `svev.import`.

    Args:
        cameras: left to right.
        starts: by camera, number of the frame that is pulse 1.
        used: by camera, how many frames are in the log.
        common: what holds for all of them.
    """
    fields = dict(common)
    for place, camera in enumerate(cameras, 1):
        film = camera.film
        fields |= {
            f"camera_{place}": camera.name,
            f"source_{place}": film.path.resolve().name,
            f"kind_{place}": film.kind,
            f"first_frame_{place}": str(starts[camera.name]),
            f"frames_{place}": str(used[camera.name]),
            f"remarks_{place}": "; ".join(film.remarks),
        }
    return fields
