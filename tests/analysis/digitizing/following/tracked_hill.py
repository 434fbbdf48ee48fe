"""Jumps of the simulated hill to track in: their images, their truth, and marks as a hand makes them."""

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.candidates.foreground.background import Background
from analysis.digitizing.following.points.tracker import Tracker
from analysis.digitizing.following.points.tracks import Mark, Track
from analysis.scene.static_image import static_image
from bench.analysis.simulated import drawn, true_cameras
from rig.arrays import Floats
from rig.pulse import HillPulse
from simrig.images.view import CameraView
from simrig.world.conditions.effects import MissingMarker
from simrig.world.truth import truth
from tests.analysis.candidates.judge import scenario

SIZE = (640, 480)
RATE_HZ = 40.0  #: so that all cameras see a jumper in more than 30 pulses
PULSES = range(30, 80)
HAND_PX = 0.3
NAMES = ("K1", "K2", "K3")


class TrackedHill:
    """One jump.

    Args:
        seed: of the jump, the noise, the marks and the errors of the cameras' orientation.
        markers: whether the jumper wears markers.
    """

    def __init__(self, seed: int, *, markers: bool = True) -> None:
        bare = () if markers else tuple(MissingMarker(marker=name) for name in ("P1", "P2", "P3", "P4"))
        shown = scenario(seed=seed, jumper={"occlusion": True, "missing_markers": bare})
        self._views = [CameraView(shown, i, *SIZE, RATE_HZ) for i in range(len(NAMES))]
        self._images: dict[int, dict[str, NDArray[np.uint8]]] = {}
        self._markers = markers
        self._rng = np.random.default_rng(seed + 1000)
        states = truth(shown, [HillPulse(pulse) for pulse in PULSES], RATE_HZ, SIZE)["pulses"]
        self.truth: dict[int, dict[str, Any]] = dict(zip(PULSES, states, strict=True))
        self.system = drawn(true_cameras(), self._rng)
        self.tracker = Tracker(self.frames, RATE_HZ, self.system)

    def frames(self, pulse: int) -> dict[str, NDArray[np.uint8]]:
        """The images of a pulse."""
        if pulse not in self._images:
            self._images[pulse] = {name: np.zeros(SIZE[::-1], np.uint8) for name in NAMES}
            for name, view in zip(NAMES, self._views, strict=True):
                view.render_into(self._images[pulse][name], HillPulse(pulse))
        return self._images[pulse]

    def background(self, pulse: int) -> dict[str, Background]:
        """The static scene as the frames of one pulse show it."""
        return {name: Background(static_image(name, [image])) for name, image in self.frames(pulse).items()}

    def true(self, pulse: int, camera: str, thing: str) -> Floats:
        """Where a thing is, px; NaN outside the image."""
        place = self.truth[pulse].get("images", {}).get(camera, {}).get(thing)
        return np.array(place if place is not None else (np.nan, np.nan), float)

    def in_sight(self, thing: str) -> list[int]:
        """Pulses at which all cameras show a thing."""

        def shown(pulse: int) -> bool:
            inside = all(np.isfinite(self.true(pulse, name, thing)).all() for name in NAMES)
            return inside and (not self._markers or all(self.truth[pulse]["in_sight"][n][thing] for n in NAMES))

        return [pulse for pulse in PULSES if shown(pulse)]

    def marks(self, pulse: int, thing: str) -> dict[str, Mark]:
        """Marks by hand in all cameras."""
        return {
            name: Mark(self.true(pulse, name, thing) + self._rng.normal(0, HAND_PX, 2), np.full(2, HAND_PX))
            for name in NAMES
        }

    def errors(self, track: Track, thing: str) -> Floats:
        """(n, 2) errors of tracked places over their sigmas."""
        return np.array(
            [
                (place.xy - self.true(pulse, name, thing)) / place.sigma
                for pulse, places in track.places.items()
                for name, place in places.items()
            ]
        ).reshape(-1, 2)


@cache
def hill(seed: int, *, markers: bool = True) -> TrackedHill:
    """A jump that several tests use."""
    return TrackedHill(seed, markers=markers)
