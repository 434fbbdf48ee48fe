"""Arrivals of cameras that have to be whole frames."""

from collections.abc import Iterable

from capture.seam import Arrival
from rig.frame import FrameRecord


def whole_frames(arrivals: Iterable[Arrival]) -> list[FrameRecord]:
    """The arrivals, all of which are whole frames."""
    frames = []
    for arrival in arrivals:
        assert isinstance(arrival, FrameRecord)
        frames.append(arrival)
    return frames
