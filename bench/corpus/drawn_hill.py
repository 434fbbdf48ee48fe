"""Images of a jump that the simulated hill has not made: only where things are comes from it, OpenCV draws them.

Balls are discs on poles before dark plates, the jumper is made of capsules, skis are polygons with prints, the ground
is a fractal with trees. The analysis must not be made for the pictures of one renderer.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import Any, Final

import cv2
import numpy as np

from rig.arrays import Floats
from rig.clocks import UtcNs
from rig.frame import FrameStatus
from rig.images.pixels import Stored
from rig.pulse import HillPulse, PulseNumber
from rig.tag import CameraTag, TripletTag
from simrig.world.projection import Projection
from simrig.world.scenario import Scenario
from simrig.world.truth import truth

SIZE: Final = (640, 480)
RATE_HZ: Final = 30.0
START: Final = UtcNs(1_795_216_434_000_000_000)
_FINER: Final = 4  # drawn with so many pixels for one
_FRACTION: Final = 4  # bits behind the point of what OpenCV draws
_MOMENTS: Final = 4
_EXPOSURE_S: Final = 0.001  # of a scenario whose cameras expose for no time
_SIGMA_M: Final = 0.004  # of the survey
_BRIGHT, _DARK, _PLATE = 236.0, 30.0, 60.0
_NOISE, _SHOT = 1.2, 0.02  # variance of a pixel, and by its grey value
_SKI: Final = ((0.0, 0.045), (0.4, 0.05), (1.13, 0.046), (1.9, 0.05), (2.3, 0.055), (2.48, 0.045))  # from the tail, m
_ABOVE: Final = np.array((0.0, 0.0, 0.05))  # of a boot over its ski
_PRINTS: Final = (0.3, 0.7, 1.7, 2.1)


class DrawnHill:
    """The scenario's cameras, balls and first jumper, drawn.

    Args:
        scenario: where things are, how large, and how the jumper flies.
        pulses: hill pulses.
        seed: of all that the scenario does not say.
        size: of the images, width and height, px.
        rate_hz: pulses per second.

    Attributes:
        known: its truth, as `simrig.world.truth` tells it, by hill pulse.
    """

    def __init__(
        self,
        scenario: Scenario,
        pulses: range,
        seed: int,
        size: tuple[int, int] = SIZE,
        rate_hz: float = RATE_HZ,
    ) -> None:
        self._rng, self._size, self._rate_hz = np.random.default_rng(seed), size, rate_hz
        self._ball_m, self._marker_m = scenario.ball_radius_m, scenario.jumper.marker_radius_m
        self._exposure_s = max(_EXPOSURE_S, *(camera.exposure_us / 1e6 for camera in scenario.cameras))
        told = truth(scenario, map(HillPulse, pulses), rate_hz, size)
        self.known: dict[int, dict[str, Any]] = {state["pulse"]: state for state in told["pulses"]}
        self._cameras = {c.name: c.projection(*size) for c in scenario.cameras}
        self._lenses = {c.name: {"c": c.c, **c.lens.model_dump()} for c in scenario.cameras}
        self._balls = {ball.name: np.array(ball.X) for ball in scenario.balls if ball.role == "control"}
        self._suit, self._sleeve, self._skis = self._rng.uniform(40, 150, 3)
        self._still = {name: self._background(camera) for name, camera in self._cameras.items()}

    def survey(self) -> dict[str, Any]:
        """The survey of the balls, with errors."""
        points = {
            name: {"role": "control", "X": list(X + self._rng.normal(0, _SIGMA_M, 3)), "sigma": [_SIGMA_M] * 3}
            for name, X in self._balls.items()
        }
        cameras = {n: {"size": list(self._size), **lens, "distortion": "projected"} for n, lens in self._lenses.items()}
        frame = {"format": "svev-network/1", "length_unit": "m", "image_frame": "pixel"}
        return {**frame, "cameras": cameras, "points": points}

    def triplets(self) -> Iterator[tuple[TripletTag, np.ndarray[Any, np.dtype[np.uint8]]]]:
        """Tag and pixels (rows, columns) of each pulse."""
        width, height = self._size
        cameras = tuple(
            CameraTag(name, (i * width, (i + 1) * width), FrameStatus.OK) for i, name in enumerate(self._cameras)
        )
        for number, state in enumerate(self.known.values(), start=1):
            time = UtcNs(START + round(number * 1e9 / self._rate_hz))
            shape = (height, width * len(cameras))
            tag = TripletTag(PulseNumber(number), time, "", "drawn", shape, cameras, complete=True)
            yield tag, np.hstack([self._frame(name, state) for name in self._cameras])

    def views(self) -> "Sequence[DrawnView]":
        """What each camera sees."""
        return [DrawnView(self, name) for name in self._cameras]

    def frame(self, name: str, pulse: HillPulse) -> Stored:
        """The image of a camera at a hill pulse, (rows, columns)."""
        return self._frame(name, self.known[pulse])

    def _background(self, camera: Projection) -> Floats:
        """What stands still, (rows, columns)."""
        width, height = self._size
        frequency = np.hypot(*np.meshgrid(np.fft.fftfreq(width), np.fft.fftfreq(height)))
        frequency[0, 0] = 1.0
        noise = np.fft.ifft2(np.fft.fft2(self._rng.normal(size=(height, width))) / frequency**1.1).real
        x, y = np.meshgrid(np.arange(width), np.arange(height))
        ground = 120 + 14 * noise / noise.std() + 60 * np.clip(0.45 - y / height, -1, 1)
        for left, top, tall in self._rng.uniform((0, 100, 20), (width, 260, 90), (25, 3)):
            inside = (np.abs(x - left) < 0.15 * (y - top)) & (y < top + tall)
            ground[inside] = 45 + 6 * self._rng.normal(size=np.count_nonzero(inside))
        drawing = _Drawing(np.clip(ground, 3, 245), (0, 0))
        for ball in sorted(self._balls.values(), key=lambda ball: -float(camera.distance(ball))):
            center, scale = camera.pixels(ball), camera.c / float(camera.distance(ball))
            foot = center + np.array((0.0, 9 * self._ball_m * scale))
            drawing.capsule(center, foot, 0.03 * scale, 0.03 * scale, 70.0)
            drawing.disc(center, 2.2 * self._ball_m * scale, _PLATE)
            drawing.disc(center, self._ball_m * scale, _BRIGHT)
        return drawing.pixels()

    def _frame(self, name: str, state: dict[str, Any]) -> np.ndarray[Any, np.dtype[np.uint8]]:
        camera, image = self._cameras[name], self._still[name].copy()
        if state["jumper_present"]:
            places = [*state["points"].values(), *state["landmarks"].values()]
            seen = camera.pixels(np.array(places))
            reach = 2.0 * camera.c / float(camera.distance(np.array(state["origin"])))
            low = np.clip(np.floor(seen.min(axis=0) - reach), 0, self._size).astype(int)
            high = np.clip(np.ceil(seen.max(axis=0) + reach), 0, self._size).astype(int)
            if (high - low > 4).all():
                part = (slice(low[1], high[1]), slice(low[0], high[0]))
                moments = [((i + 0.5) / _MOMENTS - 0.5) * self._exposure_s for i in range(_MOMENTS)]
                drawn = [self._drawn(camera, state, image[part], low, late_s) for late_s in moments]
                image[part] = np.mean(drawn, axis=0)
        blurred = cv2.GaussianBlur(image, (0, 0), 0.6)
        light = 1 + 0.01 * np.sin(0.7 * state["pulse"])
        noisy = light * blurred + np.sqrt(_NOISE + _SHOT * blurred) * self._rng.normal(size=image.shape)
        return np.asarray(np.clip(np.round(noisy), 0, 255), np.uint8)

    def _drawn(self, camera: Projection, state: dict[str, Any], ground: Floats, low: Any, late_s: float) -> Floats:
        """The jumper before a part of the background, a little later or earlier than the middle of the exposure."""
        moved = late_s * np.array(state["velocity"])
        joint = {name: np.array(X) + moved for name, X in state["landmarks"].items()}
        drawing, parts = _Drawing(ground, low), list[tuple[float, Callable[[], None]]]()

        def limb(a: Floats, b: Floats, thick: tuple[float, float], grey: float) -> None:
            distance = float(camera.distance((a + b) / 2))
            wide = [t * camera.c / distance for t in thick]
            ends = camera.pixels(a), camera.pixels(b)
            parts.append((distance, lambda: drawing.capsule(*ends, wide[0], wide[1], grey)))

        for side in ("right", "left"):
            hip, knee, ankle, shoulder, elbow, wrist = (
                joint[f"{side} {name}"] for name in ("hip", "knee", "ankle", "shoulder", "elbow", "wrist")
            )
            binding, along = np.array(state["skis"][side]["point"]) + moved, np.array(state["skis"][side]["direction"])
            self._ski(camera, drawing, binding, along)
            limb(hip, knee, (0.095, 0.065), self._suit)
            limb(knee, ankle, (0.065, 0.05), self._suit)
            limb(shoulder, elbow, (0.055, 0.045), self._sleeve)
            limb(elbow, wrist, (0.045, 0.035), self._sleeve)
            limb(ankle, binding + 0.12 * along + _ABOVE, (0.06, 0.05), 25.0)
        middle = {name: (joint[f"right {name}"] + joint[f"left {name}"]) / 2 for name in ("hip", "shoulder")}
        limb(middle["hip"], middle["shoulder"], (0.15, 0.19), self._suit)
        helmet = np.array(state["points"]["P1"]) + moved
        limb(helmet, helmet, (0.135, 0.135), 48.0)
        for _, draw in sorted(parts, key=lambda part: -part[0]):
            draw()
        visible = state["visible"][next(n for n, c in self._cameras.items() if c is camera)]
        for label, point in state["points"].items():
            if visible.get(label, 0.0) > 0.75:
                place = np.array(point) + moved
                radius = self._marker_m * camera.c / float(camera.distance(place))
                drawing.disc(camera.pixels(place), 1.5 * radius, _DARK)
                drawing.disc(camera.pixels(place), radius, _BRIGHT)
        return drawing.pixels()

    def _ski(self, camera: Projection, drawing: "_Drawing", binding: Floats, along: Floats) -> None:
        across = np.cross(along, (0.0, 0.0, 1.0))
        across /= np.linalg.norm(across)
        tail = binding - 1.13 * along
        tip = tail + 2.63 * along + 0.08 * np.cross(across, along)
        rim = [[tail + s * along + sign * half * across for s, half in _SKI] for sign in (1, -1)]
        drawing.polygon(camera.pixels(np.array([*rim[0], tip, *rim[1][::-1]])), self._skis)
        for s in _PRINTS:
            corners = ((0.0, 0.03), (0.12, 0.03), (0.12, -0.03), (0.0, -0.03))
            of_print = np.array([tail + (s + a) * along + b * across for a, b in corners])
            drawing.polygon(camera.pixels(of_print), 0.7 * self._skis + 20)


class DrawnView:
    """What one camera sees of a drawn hill."""

    def __init__(self, hill: DrawnHill, name: str) -> None:
        self._hill, self._name = hill, name

    def render_into(self, out: Stored, pulse: HillPulse) -> None:
        """See `bench.analysis.hill_logs.View`."""
        out[...] = self._hill.frame(self._name, pulse)


class _Drawing:
    """A part of an image with finer pixels, to draw in.

    Args:
        ground: (rows, columns) what it shows at first.
        low: column and row of its first pixel in the image.
    """

    def __init__(self, ground: Floats, low: Any) -> None:
        self._size, self._low = ground.shape[::-1], np.asarray(low, float)
        fine = (self._size[0] * _FINER, self._size[1] * _FINER)
        self._fine = cv2.resize(ground.astype(np.float32), fine, interpolation=cv2.INTER_NEAREST)

    def pixels(self) -> Floats:
        """What was drawn, in pixels of the image."""
        return np.asarray(cv2.resize(self._fine, self._size, interpolation=cv2.INTER_AREA), float)

    def polygon(self, corners: Floats, grey: float) -> None:
        """A polygon with corners (n, 2), px."""
        cv2.fillPoly(self._fine, [self._fixed(corners)], grey, cv2.LINE_8, _FRACTION)

    def disc(self, center: Floats, radius: float, grey: float) -> None:
        """A disc; px."""
        wide = max(1, round(radius * _FINER * 2**_FRACTION))
        cv2.circle(self._fine, self._fixed(center).tolist(), wide, grey, -1, cv2.LINE_8, _FRACTION)

    def capsule(self, a: Floats, b: Floats, wide_a: float, wide_b: float, grey: float) -> None:
        """Two discs and what lies between them; px."""
        length = float(np.hypot(*(b - a)))
        if length > 0:
            aside = np.array((a[1] - b[1], b[0] - a[0])) / length
            corners = (a + aside * wide_a, b + aside * wide_b, b - aside * wide_b, a - aside * wide_a)
            self.polygon(np.array(corners), grey)
        self.disc(a, wide_a, grey)
        self.disc(b, wide_b, grey)

    def _fixed(self, places: Floats) -> np.ndarray[Any, np.dtype[np.int32]]:
        """Places (..., 2), px, in the fixed-point numbers of OpenCV."""
        fine = (np.asarray(places) - self._low + 0.5) * _FINER - 0.5
        return np.asarray(np.round(fine * 2**_FRACTION), np.int32)
