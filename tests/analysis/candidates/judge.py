"""Candidates of a simulated hill's images beside the truth."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.candidates.finder import Finder
from analysis.candidates.model import ImageCandidates, PulseCandidates
from analysis.scene.static_image import static_image
from rig.arrays import Floats
from rig.clocks import UtcNs
from rig.frame import FrameStatus
from rig.pulse import HillPulse, PulseNumber
from rig.tag import CameraTag, TripletTag
from simrig.images.view import CameraView
from simrig.world.scenario import Scenario, load_scenario
from simrig.world.truth import truth

SIZE = (640, 480)
RATE_HZ = 30.0
CLEAR = 0.9  # share of a marker that is in sight
_BORDER = 9.0  # px: nearer to the border of the image a marker need not be found
_NEAR = 1.0  # px within which a candidate is the marker's
_SAMPLES = np.linspace(-0.5, 0.5, 41)[:, None]


@dataclass
class Verdict:
    """How candidates agree with the truth.

    Attributes:
        clear, found: markers in clear sight; those with a candidate.
        errors: (2,) px, covariances (2, 2) of those.
        false: spots that belong to no marker.
        images: number of images.
    """

    clear: int = 0
    found: int = 0
    errors: list[Floats] = field(default_factory=list)
    covariances: list[Floats] = field(default_factory=list)
    false: int = 0
    images: int = 0

    @property
    def squares(self) -> Floats:
        """(n,) normalized squared error per coordinate of each marker found."""
        pairs = zip(self.errors, self.covariances, strict=True)
        return np.array([e @ np.linalg.solve(c, e) / 2 for e, c in pairs])


def scenario(name: str = "training", seed: int | None = None, **tables: dict[str, Any]) -> Scenario:
    """A scenario that is shipped, without a stamp; `tables` change it, for instance jumper={"occlusion": True}."""
    found = load_scenario(Path(f"config/scenarios/{name}.toml")).model_copy(update={"stamp": False})
    if seed is not None:
        found = found.model_copy(update={"seed": seed})
    exposure = tables.pop("cameras", None)
    if exposure is not None:
        found = found.model_copy(update={"cameras": tuple(c.model_copy(update=exposure) for c in found.cameras)})
    changed = {key: getattr(found, key).model_copy(update=values) for key, values in tables.items()}
    return found.model_copy(update=changed)


class Hill:
    """Images, finder and truth of a scenario.

    Args:
        shown: the scenario.
        size: width and height of the images, px.
        rate_hz: of the pulses.
    """

    def __init__(self, shown: Scenario, size: tuple[int, int] = SIZE, rate_hz: float = RATE_HZ) -> None:
        self.scenario, self.size, self.rate_hz = shown, size, rate_hz
        self._views = [CameraView(shown, i, *size, rate_hz) for i in range(len(shown.cameras))]
        pulses = [round(p * rate_hz / RATE_HZ) for p in range(1, 120, 8)]
        frames = [self.triplet(pulse) for pulse in pulses]
        names = [camera.name for camera in shown.cameras]
        blocks = {name: [f[:, i * size[0] : (i + 1) * size[0]] for f in frames] for i, name in enumerate(names)}
        self.static = {name: static_image(name, block) for name, block in blocks.items()}
        self.finder = Finder(self.static)

    def triplet(self, pulse: int) -> NDArray[np.uint8]:
        """The images of a pulse side by side."""
        width, height = self.size
        out = np.zeros((height, width * len(self._views)), np.uint8)
        for i, view in enumerate(self._views):
            view.render_into(out[:, i * width : (i + 1) * width], HillPulse(pulse))
        return out

    def tag(self, pulse: int, lost: Sequence[str] = ()) -> TripletTag:
        """The tag of a pulse."""
        width, height = self.size
        cameras = tuple(
            CameraTag(
                camera.name,
                (i * width, (i + 1) * width),
                FrameStatus.LOST if camera.name in lost else FrameStatus.OK,
            )
            for i, camera in enumerate(self.scenario.cameras)
        )
        shape = (height, width * len(cameras))
        return TripletTag(PulseNumber(pulse), UtcNs(0), "", "", shape, cameras)

    def find(self, pulse: int) -> PulseCandidates:
        """Its candidates."""
        return self.finder.find(self.tag(pulse), self.triplet(pulse))

    def truth(self, pulses: Sequence[int]) -> list[dict[str, Any]]:
        """The truth of some pulses."""
        states = truth(self.scenario, [HillPulse(p) for p in pulses], self.rate_hz, self.size)["pulses"]
        return list(states)


def judged(hill: Hill, pulses: Sequence[int]) -> Verdict:
    """Find the candidates of some pulses and compare them with the truth."""
    verdict = Verdict()
    for pulse, state in zip(pulses, hill.truth(pulses), strict=True):
        candidates = hill.find(pulse)
        for camera in hill.scenario.cameras:
            verdict.images += 1
            image = candidates.images[camera.name]
            if state["jumper_present"]:
                _judge_spots(verdict, image, state["images"][camera.name], state["visible"][camera.name], hill.size)
            else:
                verdict.false += len(image.spots)
    return verdict


def _judge_spots(
    verdict: Verdict,
    image: ImageCandidates,
    places: dict[str, list[float] | None],
    visible: dict[str, float],
    size: tuple[int, int],
) -> None:
    taken = set()
    for name, place in places.items():
        if place is None:
            continue
        off = image.spots.xy - place
        distance = np.hypot(*off.T)
        k = int(distance.argmin()) if len(distance) else -1
        hit = k >= 0 and distance[k] < max(_NEAR, 4 * np.sqrt(np.trace(image.spots.covariance[k]) / 2))
        if hit:
            taken.add(k)
        inside = all(_BORDER < v < s - 1 - _BORDER for v, s in zip(place, size, strict=True))
        if visible[name] < CLEAR or not inside:
            continue
        verdict.clear += 1
        if hit:
            verdict.found += 1
            verdict.errors.append(off[k])
            verdict.covariances.append(image.spots.covariance[k])
    verdict.false += len(image.spots) - len(taken)
