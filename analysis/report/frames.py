"""Reads the images of chosen pulses of a log, one at a time."""

from collections.abc import Collection, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from recorder.reading.parts import RecordingReader
from recorder.reading.triplets import stored_triplets
from rig.images.picture import shown
from rig.tag import TripletTag

Grey = NDArray[np.uint8]


def frames_of(log: Path, pulses: Collection[int]) -> Iterator[tuple[TripletTag, Grey]]:
    """Tag and image (rows, columns) of each of these pulses that the log has an image of, in the order of the log.

    The image is valid until the next one is taken. Pulses whose image is damaged are left out.

    Raises:
        BadInputError: no such file, no MCAP log, or not one of ours.
    """
    wanted = frozenset(pulses)
    with RecordingReader(log, skim=True) as reader:
        for stored in stored_triplets(reader):
            if stored.tag.pulse in wanted:
                try:
                    image = shown(stored.image(reader), stored.tag.pixels)
                except ValueError:
                    continue  # the account of the log (`svev verify`) names damaged chunks
                yield stored.tag, image
