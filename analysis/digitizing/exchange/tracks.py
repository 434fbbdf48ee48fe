"""Marks as other digitizers hold them: a place, or none, for each track in each camera and frame.

Those programs know no states and no sigmas: only what is measured has a place there. The points of a line are tracks of
their own.
"""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from pydantic import ValidationError

from analysis.digitizing.marks.journal import Entered, Key
from analysis.digitizing.marks.things import is_line
from rig.api.digitizing import Mark, MarkState
from rig.arrays import Floats
from rig.errors import BadInputError

_VERTEX: Final = re.compile(r"(.+) ([0-9]{1,3})")


@dataclass(frozen=True, slots=True, eq=False)
class Tracks:
    """Tracks of points.

    Attributes:
        names: of the t tracks.
        cameras: names of the m cameras.
        first_pulse: pulse of the first frame.
        xy: (f, t, m, 2) px, (0, 0) = centre of the top-left pixel; NaN where nothing is measured.
    """

    names: Sequence[str]
    cameras: Sequence[str]
    first_pulse: int
    xy: Floats

    def marks(self) -> list[tuple[Key, Entered]]:
        """The marks, all of them measured by hand, in the order of their keys.

        Raises:
            BadInputError: a name is none of a thing, or a place lies far outside of every image.
        """
        found = []
        for frame, track, camera in np.argwhere(np.isfinite(self.xy).all(-1)).tolist():
            thing, vertex = _thing(self.names[track])
            x, y = self.xy[frame, track, camera].tolist()
            key = Key(self.first_pulse + frame, self.cameras[camera], thing, vertex)
            try:
                Mark(pulse=key.pulse, camera=key.camera, thing=thing, xy=(x, y))
            except ValidationError as error:
                first = error.errors()[0]
                where = f"{thing!r} at pulse {key.pulse} in {key.camera}"
                raise BadInputError(f"{where}: {first['loc'][0]}: {first['msg']}; correct it") from None
            found.append((key, Entered(MarkState.MEASURED, (x, y))))
        return sorted(found, key=lambda item: item[0])


def tracks_of(marks: Iterable[tuple[Key, Entered]], cameras: Sequence[str], pulses: range) -> tuple[Tracks, list[str]]:
    """The tracks of all that is measured, a frame for each pulse.

    Args:
        marks: of an operator.
        cameras: names of the log's cameras, left to right.
        pulses: of the log, without gaps; marks of others are left out.

    Returns:
        The tracks, and a note for people if marks are no part of them: guesses, what is hidden or not visible, marks
        elsewhere.
    """
    places: dict[tuple[int, str, int], tuple[float, float]] = {}
    left_out = 0
    for key, mark in marks:
        if mark.state is MarkState.MEASURED and mark.xy is not None and key.camera in cameras and key.pulse in pulses:
            name = key.thing if key.vertex < 0 else f"{key.thing} {key.vertex}"
            places[key.pulse - pulses.start, name, cameras.index(key.camera)] = mark.xy
        else:
            left_out += 1
    names = sorted({name for _, name, _ in places}, key=_thing)
    xy = np.full((len(pulses), len(names), len(cameras), 2), np.nan)
    for (frame, name, camera), place in places.items():
        xy[frame, names.index(name), camera] = place
    notes = [f"{left_out} marks without a measured place are not in it"] if left_out else []
    return Tracks(names, tuple(cameras), pulses.start, xy), notes


def _thing(name: str) -> tuple[str, int]:
    """The thing of a track, and which of its points it is, -1 if it is no line."""
    found = _VERTEX.fullmatch(name)
    if found is not None and is_line(found[1]):
        return found[1], int(found[2])
    return name, -1
