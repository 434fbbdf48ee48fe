"""Finds the candidates of all images of a recording, and looks again where an identification expects something.

What is in front of the static scene is cut out of each image and kept in memory: for skis, which are fitted to grey
values where a jumper is known to be, and for the second look, which is given a predicted place with its covariance and
takes weaker evidence there. Pixels that are a signature of the camera
(`stamped` in the tag) are no picture and are never looked at.
"""

from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from msgspec import UNSET

from analysis.candidates.foreground.background import Background, Region
from analysis.candidates.foreground.pace import Pace
from analysis.candidates.markers.known_discs import DiscShape, Windows, fit_known_discs, half_size
from analysis.candidates.markers.spots import MOST, find_expected, find_spots, look_for_spots
from analysis.candidates.model import Expected, ImageCandidates, PulseCandidates, Spots
from analysis.scene.static_image import StaticImage
from recorder.reading.parts import RecordingReader
from recorder.reading.triplets import stored_triplets, triplets
from rig.arrays import Floats, Integers
from rig.errors import BadInputError
from rig.frame import FrameStatus
from rig.images.picture import Grey, measurable
from rig.pulse import PulseNumber
from rig.tag import CameraTag, TripletTag

_MEMORY = 192 << 20  # bytes of regions that are kept for a second look; the oldest pulses make room

_FITS_OF_OTHERS = 20  # places of each region but the largest: four markers, and clearer false ones
_FITS_OF_STILL = 8  # places in a region that hardly moves: a jumper who passes it shows four markers


class Finder:
    """Finds candidates in the images of one recording.

    Args:
        static: static image of each camera; cameras without one are left out.
        memory: bytes that are kept for second looks.
    """

    def __init__(self, static: Mapping[str, StaticImage], memory: int = _MEMORY) -> None:
        self._backgrounds = {name: Background(image) for name, image in static.items()}
        self._regions: OrderedDict[tuple[PulseNumber, str], list[Region]] = OrderedDict()
        self._paces: dict[str, Pace] = {}
        self._kept, self._memory = 0, memory

    def find(self, tag: TripletTag, image: Grey) -> PulseCandidates:
        """The candidates of a pulse; keeps what a second look needs.

        In regions that were in front at the same place a moment ago (people who stand or walk) few places are fitted.

        Args:
            tag: of the pulse; pulses come in order.
            image: (rows, columns) all cameras side by side.

        Raises:
            BadInputError: an image is not as large as the static image of its camera.
        """
        names: list[str] = []
        images: list[list[Region]] = []
        most: list[list[int]] = []
        for camera, background, block in self._blocks(tag, image):
            regions = background.regions(block, _stamped(camera))
            still = self._paces.setdefault(camera.name, Pace()).still(tag.time, regions)
            most.append([MOST, *[_FITS_OF_OTHERS] * (len(regions) - 1)][: len(regions)])
            for i in np.flatnonzero(still):
                most[-1][i] = _FITS_OF_STILL
            names.append(camera.name)
            images.append(regions)
            self._keep(tag.pulse, camera.name, regions)
        spots = find_spots(images, most)
        return PulseCandidates(tag.pulse, tag.time, dict(zip(names, map(ImageCandidates, spots), strict=True)))

    def find_expected(self, tag: TripletTag, image: Grey, expected: Mapping[str, Expected]) -> PulseCandidates:
        """The candidates of a pulse near where a jumper is expected: faster than all of them.

        Args:
            tag: of the pulse.
            image: (rows, columns) all cameras side by side.
            expected: by camera; images of others have no candidates.

        Raises:
            BadInputError: see `find`.
        """
        names: list[str] = []
        places: list[Expected | None] = []
        images: list[list[Region]] = []
        for camera, background, block in self._blocks(tag, image):
            place = expected.get(camera.name)
            box = None if place is None else _inside(place.box, background.shape)
            regions = [] if box is None else background.regions(block, _stamped(camera), box)
            names.append(camera.name)
            places.append(place)
            images.append(regions)
            self._keep(tag.pulse, camera.name, regions)
        spots = find_expected(images, places)
        return PulseCandidates(tag.pulse, tag.time, dict(zip(names, map(ImageCandidates, spots), strict=True)))

    def _blocks(self, tag: TripletTag, image: Grey) -> Iterator[tuple[CameraTag, Background, Grey]]:
        """The cameras that delivered, with their static scene and their part of the image."""
        for camera in tag.cameras:
            background = self._backgrounds.get(camera.name)
            if camera.status is not FrameStatus.OK or background is None:
                continue
            block = image[camera.part]
            if block.shape != background.shape:
                raise BadInputError(
                    f"{camera.name}: image of {block.shape[1]} x {block.shape[0]} px, but the static image has "
                    f"{background.shape[1]} x {background.shape[0]} px; compute both from the same recording"
                )
            yield camera, background, block

    def look_for_spots(self, pulses: Sequence[PulseNumber], camera: str, xy: Floats, covariance: Floats) -> list[Spots]:
        """Spots near predicted places, on weaker evidence than at first sight; the nearest by chi-squared first.

        Args:
            pulses: (n) of the images, searched before, not longer ago than the memory reaches.
            camera: its name.
            xy: (n, 2) predicted places, px.
            covariance: (n, 2, 2) of the predictions, px^2.

        Returns:
            Those of each place; none at all also where nothing was in front of the static scene.
        """
        found = [Spots.none() for _ in pulses]
        regions = {
            i: region
            for i, (pulse, place) in enumerate(zip(pulses, xy, strict=True))
            if (region := next((own for own in self._regions.get((pulse, camera), ()) if own.holds(place)), None))
        }
        there = list(regions)
        for i, spots in zip(there, look_for_spots([*regions.values()], xy[there], covariance[there]), strict=True):
            found[i] = spots
        return found

    def fit_discs(self, pulses: Sequence[PulseNumber], camera: str, xy: Floats, shape: DiscShape) -> Spots:
        """Discs of known size near some places, each in an image of its own or with others in one.

        Args:
            pulses: (n) of the images, searched before, not longer ago than the memory reaches.
            camera: its name.
            xy: (n, 2) px.
            shape: of the n discs.

        Returns:
            n spots; NaN where there is no such disc, or nothing was in front of the static scene.
        """
        half = half_size(shape)
        first = np.rint(xy).astype(int) - half
        side = 2 * half + 1
        grey, noise = np.zeros((len(xy), side, side)), np.full((len(xy), side, side), np.inf)
        for i, pulse in enumerate(pulses):
            for region in self._regions.get((pulse, camera), ()):
                if region.holds(xy[i]):
                    region.copy_into(grey[i], noise[i], first[i])
                    break
        there = np.isfinite(noise).any(axis=(1, 2))
        spots = Spots(
            np.full((len(xy), 2), np.nan), np.full((len(xy), 2, 2), np.nan), shape.radius, *np.zeros((2, len(xy)))
        )
        if not there.any():
            return spots
        discs = fit_known_discs(
            Windows((xy - first)[there], grey[there], noise[there]), shape.of(np.flatnonzero(there))
        )
        spots.xy[there], spots.covariance[there] = discs.xy + first[there], discs.covariance
        spots.contrast[there] = discs.contrast
        spots.strength[there] = np.abs(discs.contrast) / discs.sigma_contrast
        return spots

    def part(self, pulse: PulseNumber, camera: str, low: Integers, high: Integers) -> Region | None:
        """A part of an image, with the static scene where nothing was in front of it.

        Args:
            pulse: searched before, not longer ago than the memory reaches.
            camera: its name.
            low: first column and row, perhaps outside of the image.
            high: column and row behind the last ones.

        Returns:
            What of it lies in the image; None if nothing does, or if the image is not known any more.
        """
        regions, background = self._regions.get((pulse, camera)), self._backgrounds.get(camera)
        if regions is None or background is None:
            return None
        part = background.still(low, high)
        if part is not None:
            for region in reversed(regions):
                region.copy_over(part)
        return part

    def _keep(self, pulse: PulseNumber, camera: str, regions: list[Region]) -> None:
        self._forget((pulse, camera))
        self._regions[pulse, camera] = regions
        self._kept += sum(region.nbytes for region in regions)
        while self._kept > self._memory and len(self._regions) > 1:
            self._forget(next(iter(self._regions)))

    def _forget(self, image: tuple[PulseNumber, str]) -> None:
        """Give the memory of an image back."""
        self._kept -= sum(region.nbytes for region in self._regions.pop(image, ()))


def find_candidates(
    log: Path, finder: Finder, progress: Callable[[float], None] | None = None
) -> list[PulseCandidates]:
    """The candidates of every pulse of a log.

    Args:
        log: the log; of a damaged one, the part that can be read.
        finder: with the static images of this log.
        progress: is called with the share that is done.

    Raises:
        BadInputError: no such log, or its images are not as large as the static ones.
    """
    total = 0
    if progress is not None:
        with RecordingReader(log) as reader:
            total = len(stored_triplets(reader))
    found = []
    for tag, image in triplets(log):
        found.append(finder.find(tag, measurable(image, tag.pixels)))
        if progress is not None:
            progress(min(1.0, len(found) / max(1, total)))
    return found


def _inside(box: Floats, shape: tuple[int, int]) -> tuple[int, int, int, int] | None:
    """The part of a box (`Expected.box`) that lies in an image of so many rows and columns; None if none does."""
    left, top = np.maximum(np.floor(box[0]).astype(int), 0).tolist()
    right, bottom = np.minimum(np.ceil(box[1]).astype(int) + 1, shape[::-1]).tolist()
    return (left, top, right, bottom) if left < right and top < bottom else None


def _stamped(camera: CameraTag) -> tuple[int, int, int] | None:
    """Row, first column in the camera's block, and count of pixels that are no picture."""
    if camera.stamped is UNSET:
        return None
    row, column, count = camera.stamped
    return row, column - camera.columns[0], count
