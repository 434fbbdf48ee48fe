"""Single frames of a log by pulse, for measurements in some of them."""

from collections.abc import Collection, Iterator, Mapping
from pathlib import Path
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from recorder.reading.parts import RecordingReader
from recorder.reading.triplets import StoredTriplet, stored_triplets
from rig.frame import FrameStatus
from rig.images.picture import Grey, measurable
from rig.pulse import PulseNumber
from rig.tag import TripletTag

#: Images (rows, columns) by camera; valid until the next pulse is taken.
Frames = Mapping[str, Grey]
_Image = TypeVar("_Image", NDArray[np.uint8], Grey)


class FrameSource(Protocol):
    """Something that holds frames."""

    @property
    def pulses(self) -> tuple[PulseNumber, ...]:
        """All pulses with a frame, in order."""

    def frames(self, pulses: Collection[int]) -> Iterator[tuple[PulseNumber, Frames]]:
        """The frames of some pulses, in order; those that are not there are left out."""


class LogFrames:
    """The frames of a log; damaged images are left out.

    Args:
        log: the log; of a damaged one, the part that can be read.
    """

    def __init__(self, log: Path) -> None:
        self._log = log
        with RecordingReader(log) as reader:
            stored = stored_triplets(reader)
        self._stored: dict[PulseNumber, StoredTriplet] = {triplet.tag.pulse: triplet for triplet in stored}

    @property
    def pulses(self) -> tuple[PulseNumber, ...]:
        """All pulses with a frame, in order."""
        return tuple(sorted(self._stored))

    def frames(self, pulses: Collection[int]) -> Iterator[tuple[PulseNumber, Frames]]:
        """The frames of some pulses, in order; cameras without one are left out."""
        with RecordingReader(self._log) as reader:
            for pulse in self.pulses:
                if pulse not in pulses:
                    continue
                triplet = self._stored[pulse]
                try:
                    image = measurable(triplet.image(reader), triplet.tag.pixels)
                except ValueError:
                    continue  # `svev verify` names it; other pulses are not touched
                yield pulse, camera_images(triplet.tag, image)


def camera_images(tag: TripletTag, image: _Image) -> dict[str, _Image]:
    """The frames that cameras delivered at a pulse."""
    return {camera.name: image[camera.part] for camera in tag.cameras if camera.status is FrameStatus.OK}
