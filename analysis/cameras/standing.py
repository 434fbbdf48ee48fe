"""How the cameras stood during a jump: their poses, and the shake of single frames, which is taken out of measurements.

A frame of a camera that was turned by a known small angle shows every point where the camera at rest would show it, but
for a projective map of the image that does not depend on the distance. Measurements that went through it belong to the
one pose of the jump, and everything after them need not know of the shake.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from analysis.candidates.foreground.background import Region
from analysis.candidates.markers.known_discs import DiscShape
from analysis.candidates.model import ImageCandidates, PulseCandidates, SecondLook, Spots
from analysis.measurements.model import (
    ImageMeasurements,
    JumpMeasurements,
    PulseMeasurements,
)
from analysis.scene.camera_system import CameraSystem, PlacedCamera
from photogrammetry.geometry.camera_model import distort
from photogrammetry.geometry.rotation import rotation_from_vector
from rig.arrays import Floats, Integers
from rig.pulse import PulseNumber

_DIFFERENCE = 1e-6  # rad, for derivatives


@dataclass(frozen=True, slots=True, eq=False)
class FrameShake:
    """How a camera stood in one frame, against its pose in the jump.

    Attributes:
        turn: (3,) rad, about the camera's own axes.
        covariance: (3, 3).
    """

    turn: Floats
    covariance: Floats

    def reversed(self) -> "FrameShake":
        """The shake that undoes this one, and is known: it leads from steadied places back to those in the frame."""
        return FrameShake(-self.turn, np.zeros((3, 3)))


@dataclass(frozen=True, slots=True, eq=False)
class SteadiedJump:
    """A jump as it would have been measured in frames that do not shake.

    Attributes:
        measurements: in the frames of `system`.
        system: the cameras as they stood during the jump.
    """

    measurements: JumpMeasurements
    system: CameraSystem


@dataclass(frozen=True, slots=True, eq=False)
class Standing:
    """The cameras during a jump.

    Attributes:
        system: their poses.
        shake: by camera and pulse; cameras that stood still are left out.
    """

    system: CameraSystem
    shake: Mapping[str, Mapping[PulseNumber, FrameShake]]

    def candidates(self, seen: Sequence[PulseCandidates]) -> list[PulseCandidates]:
        """Candidates of some pulses where the cameras of `system` would show them."""
        images = [dict(pulse.images) for pulse in seen]
        for name, shakes in self.shake.items():
            if name not in self.system.cameras:
                continue
            shaken = [i for i, pulse in enumerate(seen) if name in pulse.images and pulse.pulse in shakes]
            spots = [images[i][name].spots for i in shaken]
            of_spot = [shakes[seen[i].pulse] for i, own in zip(shaken, spots, strict=True) for _ in range(len(own))]
            joined = Spots.joined(spots)
            xy, added = steadied_each(self.system[name], of_spot, joined.xy)
            joined = replace(joined, xy=xy, covariance=joined.covariance + added)
            ends = np.cumsum([0, *map(len, spots)])
            for i, first, last in zip(shaken, ends[:-1], ends[1:], strict=True):
                images[i][name] = ImageCandidates(joined.only(np.arange(first, last)))
        return [replace(pulse, images=own) for pulse, own in zip(seen, images, strict=True)]

    def measurements(self, seen: PulseMeasurements) -> PulseMeasurements:
        """Measurements in the frames as the cameras of `system` would have made them."""
        return self._measurements(seen, back=False)

    def steadied(self, jump: JumpMeasurements) -> SteadiedJump:
        """A jump that was measured in the frames as they are, where the cameras of `system` would show it."""
        return SteadiedJump(replace(jump, pulses=tuple(self.measurements(pulse) for pulse in jump.pulses)), self.system)

    def in_frames(self, steadied: PulseMeasurements) -> PulseMeasurements:
        """The inverse of `measurements`: where the frames themselves show what was measured. Covariances stay."""
        return self._measurements(steadied, back=True)

    def look(self, look: SecondLook) -> SecondLook:
        """A second look that takes and gives places as the cameras of `system` would show them.

        Args:
            look: takes and gives places in the frames.
        """
        return _SteadyLook(self, look)

    def _measurements(self, seen: PulseMeasurements, *, back: bool) -> PulseMeasurements:
        images = {}
        for name, image in seen.images.items():
            shake = self.shake.get(name, {}).get(seen.pulse)
            if shake is None or name not in self.system.cameras:
                images[name] = image
            else:
                images[name] = _image_measurements(self.system[name], shake.reversed() if back else shake, image)
        return replace(seen, images=images)


class _SteadyLook:
    """A second look at frames that shake."""

    def __init__(self, standing: Standing, look: SecondLook) -> None:
        self._standing, self._look = standing, look

    def look_for_spots(self, pulses: Sequence[PulseNumber], camera: str, xy: Floats, covariance: Floats) -> list[Spots]:
        """See `SecondLook`."""
        found = self._look.look_for_spots(pulses, camera, self._in_frames(pulses, camera, xy), covariance)
        owner = np.repeat(np.arange(len(pulses)), [len(spots) for spots in found])
        steady = self._steadied([pulses[i] for i in owner.tolist()], camera, Spots.joined(found))
        return [steady.only(owner == i) for i in range(len(pulses))]

    def fit_discs(self, pulses: Sequence[PulseNumber], camera: str, xy: Floats, shape: DiscShape) -> Spots:
        """See `SecondLook`."""
        found = self._look.fit_discs(pulses, camera, self._in_frames(pulses, camera, xy), shape)
        return self._steadied(pulses, camera, found)

    def part(self, pulse: PulseNumber, camera: str, low: Integers, high: Integers) -> Region | None:
        """See `SecondLook`; what a shaken frame shows is brought to where the camera of the jump would show it."""
        placed = self._standing.system[camera]
        low, high = np.maximum(low, 0), np.minimum(high, placed.size.astype(int))
        if pulse not in self._standing.shake.get(camera, {}) or (high - low <= 1).any():
            return self._look.part(pulse, camera, low, high)
        corners = np.array([low, (high[0] - 1, low[1]), (low[0], high[1] - 1)], float)
        there = self._in_frames([pulse] * len(corners), camera, corners)
        whole = np.concatenate((there, [there[1] + there[2] - there[0]]))
        seen = self._look.part(pulse, camera, np.floor(whole.min(axis=0)).astype(int), _behind(whole))
        if seen is None:
            return None
        # a small turn moves what is near together like a plane
        back = cv2.getAffineTransform((corners - low).astype(np.float32), (there - (seen.x, seen.y)).astype(np.float32))
        size, how = (int(high[0] - low[0]), int(high[1] - low[1])), cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        grey, behind, sigma, noise = (
            np.asarray(cv2.warpAffine(layer, back, size, flags=how, borderMode=cv2.BORDER_REPLICATE), np.float32)
            for layer in (seen.grey, seen.behind, seen.sigma, seen.noise)
        )
        front = cv2.warpAffine(seen.front.astype(np.uint8), back, size, flags=how) > 0
        return Region(int(low[0]), int(low[1]), grey, behind, sigma, noise, front)

    def _in_frames(self, pulses: Sequence[PulseNumber], camera: str, xy: Floats) -> Floats:
        """Where the frames of n pulses show places (n, 2)."""
        there, shakes = self._shaken(pulses, camera)
        places = xy.copy()
        if there:
            reversed_ = [shake.reversed() for shake in shakes]
            places[there] = steadied_each(self._standing.system[camera], reversed_, xy[there])[0]
        return places

    def _steadied(self, pulses: Sequence[PulseNumber], camera: str, spots: Spots) -> Spots:
        """Spots (n) in the frames of n pulses where the camera of the jump would show them."""
        there, shakes = self._shaken(pulses, camera)
        if not there:
            return spots
        found, covariance = spots.xy.copy(), spots.covariance.copy()
        found[there], added = steadied_each(self._standing.system[camera], shakes, spots.xy[there])
        covariance[there] += added
        return replace(spots, xy=found, covariance=covariance)

    def _shaken(self, pulses: Sequence[PulseNumber], camera: str) -> tuple[list[int], list[FrameShake]]:
        """Which of n pulses have a shaken frame of a camera, and how it is shaken."""
        shakes = self._standing.shake.get(camera, {})
        there = [i for i, pulse in enumerate(pulses) if pulse in shakes]
        return there, [shakes[pulses[i]] for i in there]


def _behind(xy: Floats) -> Integers:
    """Column and row behind the last of some places (n, 2)."""
    return np.asarray(np.ceil(xy.max(axis=0)).astype(int) + 1)


def steadied(placed: PlacedCamera, shake: FrameShake, xy: Floats) -> tuple[Floats, Floats]:
    """Where the camera of the jump shows what a frame shows.

    Args:
        placed: the camera of the jump.
        shake: of the frame.
        xy: (n, 2) px in the frame.

    Returns:
        (n, 2) px, and (n, 2, 2) the covariance that the uncertainty of the shake adds.
    """
    return steadied_each(placed, [shake] * len(xy), xy)


def steadied_each(placed: PlacedCamera, shakes: Sequence[FrameShake], xy: Floats) -> tuple[Floats, Floats]:
    """The same for n places, each in a frame of its own; see `steadied`."""
    turn = np.array([shake.turn for shake in shakes]).reshape(-1, 3)
    covariance = np.array([shake.covariance for shake in shakes]).reshape(-1, 3, 3)
    turns = turn + _DIFFERENCE * np.concatenate((np.zeros((1, 3)), np.eye(3)))[:, None]
    ideal = placed.reduced(xy)
    c = float(placed.camera.interior[0])
    rays = np.concatenate((ideal, np.full((*ideal.shape[:-1], 1), -c)), axis=-1)
    turned = np.einsum("knij,nj->kni", rotation_from_vector(turns), rays)
    seen = np.asarray(distort(placed.camera.lens(), -c * turned[..., :2] / turned[..., 2:]), float)
    places = seen * np.array((1.0, -1.0)) + (placed.size - 1) / 2
    by_turn = ((places[1:] - places[0]) / _DIFFERENCE).transpose(1, 2, 0)
    return places[0], by_turn @ covariance @ by_turn.transpose(0, 2, 1)


def _all_steadied(placed: PlacedCamera, shake: FrameShake, places: Sequence[Floats]) -> list[tuple[Floats, Floats]]:
    """What `steadied` gives for several arrays of places in one frame, all at once."""
    xy, added = steadied(placed, shake, np.concatenate(places))
    ends = np.cumsum([len(part) for part in places])[:-1]
    return list(zip(np.split(xy, ends), np.split(added, ends), strict=True))


def _image_measurements(placed: PlacedCamera, shake: FrameShake, image: ImageMeasurements) -> ImageMeasurements:
    points, skis = image.points, image.skis
    places = [*(point.xy[None] for point in points.values()), *(ski.xy for ski in skis.values())]
    if not places:
        return image
    found = _all_steadied(placed, shake, places)
    return ImageMeasurements(
        {
            name: replace(point, xy=xy[0], covariance=point.covariance + added[0])
            for (name, point), (xy, added) in zip(points.items(), found[: len(points)], strict=True)
        },
        {
            side: replace(ski, xy=xy, common=_common(ski.common, added))
            for (side, ski), (xy, added) in zip(skis.items(), found[len(points) :], strict=True)
        },
    )


def _common(before: float, added: Floats) -> float:
    """The error that all points of a line share: a turn of the camera moves them all alike."""
    return float(np.sqrt(before**2 + np.trace(added.mean(axis=0)) / 2))
