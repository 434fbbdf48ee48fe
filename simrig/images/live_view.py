"""Renders scenes in which more than the jumper changes: light, weather, surroundings, the camera's own pose.

Order, from back to front: hill, what is behind the balls, balls, jumper, what is in front of him, snow in the air, the
lens; then the light of the moment, and the sensor's noise.
"""

import cv2
import numpy as np

from rig.images.pixels import Stored
from rig.pulse import HillPulse
from simrig.images import exposure
from simrig.images.scene.background import paint
from simrig.images.scene.balls import Balls
from simrig.images.scene.drawing import Image
from simrig.images.scene.figure import Figure
from simrig.images.scene.light import Reflections, glare
from simrig.images.scene.surroundings import Around
from simrig.images.scene.weather import LENS_SNOW, DenseSnow, lens_snow
from simrig.images.sensor import Sensor
from simrig.world.conditions.camera_motion import CameraMotion
from simrig.world.conditions.daylight import Daylight
from simrig.world.jumper import JumpSeries
from simrig.world.projection import Projection
from simrig.world.scenario import BRIGHTEST, Scenario

_CROUCH_S = -0.35  #: since take-off: the posture of somebody who waits
_FAR_M = 60.0  #: distance of the plane by which the hill is moved with the camera's translation


class LiveView:
    """Renders one camera's images; the same seed, camera and pulse give the same image.

    Args:
        scenario: what there is to see.
        camera: index of the camera in it.
        width: width of the image, px.
        height: height of the image, px.
        rate_hz: rate of the pulses.
        bits: of a pixel.
    """

    def __init__(self, scenario: Scenario, camera: int, width: int, height: int, rate_hz: float, bits: int = 8) -> None:
        self._scenario, self._rate_hz = scenario, rate_hz
        self._settings = scenario.cameras[camera]
        self._jumps = JumpSeries(scenario)
        self._projection = self._settings.projection(width, height)
        self._motion = CameraMotion(scenario, camera)
        self._figure = Figure(scenario, self._projection, 0.0, 1.0)
        self._hill = _Hill(self._with_waiting(paint(scenario, self._projection)), self._projection)
        self._balls = Balls(scenario, self._projection)
        self._around = Around(scenario, self._projection)
        rng = np.random.default_rng((scenario.seed, camera, 97))
        weather, light = scenario.weather, scenario.light
        self._snow = DenseSnow(weather.snowfall, width, height, rng) if weather.snowfall else None
        self._lens: tuple[Image, Image] | None = None
        if weather.lens_snow or light.glare_spots:
            cover = lens_snow(weather.lens_snow, width, height, rng)
            self._lens = 1 - cover, cover * np.float32(LENS_SNOW) + glare(light.glare_spots, width, height, rng)
        self._reflections = Reflections(scenario, camera) if light.reflections else None
        self._daylight = Daylight(light, scenario.seed)
        self._sensor = Sensor(scenario.image, scenario.seed, camera, (height, width), bits)
        self._image: Image = np.empty((height, width), np.float32)

    def render_into(self, out: Stored, pulse: HillPulse) -> None:
        """Render the image of hill pulse `pulse` into `out`, shape (height, width); its rows may lie apart."""
        image, scene_s = self._image, self._settings.middle_s(pulse, self._rate_hz)
        exposure_s = self._settings.exposure_us / 1e6
        projection = self._motion.at(self._projection, scene_s)
        there = self._jumps.at(scene_s)
        distance = None if there is None else float(projection.distance(there[0].origin(there[1])))
        self._hill.show(image, projection)
        self._around.draw_behind(image, projection, scene_s, distance)
        if self._motion.still:
            self._balls.paste(image)
        else:
            self._balls.draw(image, projection)
        if self._reflections is not None:
            self._reflections.draw(image, projection, scene_s)
        if there is not None:
            jump, time_s = there
            poses = exposure.poses(jump, time_s, exposure_s, projection)
            drawn = self._figure.draw(poses, projection, image, self._scenario.jumper.worn(jump.number))
            if drawn is not None:
                rows, columns, sprite = drawn
                image[rows, columns] = sprite
        self._around.draw_in_front(image, projection, scene_s, distance)
        if self._snow is not None:
            self._snow.draw(image, scene_s)
        if self._lens is not None:
            image *= self._lens[0]
            image += self._lens[1]
        image *= np.float32(self._settings.gain * self._daylight.at(scene_s, exposure_s))
        image += np.float32(self._scenario.image.black_level)
        self._sensor.read(image, out, pulse)

    def _with_waiting(self, hill: Image) -> Image:
        """The hill with the jumpers who wait; they do not move."""
        posture = self._jumps.first().posture
        for person in self._scenario.surroundings.people:
            if person.kind == "jumper":
                pose = posture.pose(_CROUCH_S, np.array(person.X))
                drawn = self._figure.draw([pose], self._projection, hill)
                if drawn is not None:
                    rows, columns, sprite = drawn
                    hill[rows, columns] = sprite
        return np.clip(hill, 0, BRIGHTEST)


class _Hill:
    """What never moves, seen from a camera that does.

    The picture is moved by the homography of four far points. Balls and jumper are drawn at their exact places instead.
    """

    def __init__(self, picture: Image, projection: Projection) -> None:
        self._picture = picture
        self._still = self._latest = projection
        self._moved = picture
        aside, up = 0.45 * projection.width / projection.c, 0.45 * projection.height / projection.c
        rays = np.array([(u * aside, v * up, -1.0) for u, v in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
        self._far = projection.X0 + _FAR_M * rays @ projection.R.T

    def show(self, image: Image, projection: Projection) -> None:
        """Copy the hill as this projection shows it into an image, shape (h, w)."""
        if not (np.array_equal(projection.R, self._latest.R) and np.array_equal(projection.X0, self._latest.X0)):
            self._moved, self._latest = self._seen(projection), projection
        np.copyto(image, self._moved)

    def _seen(self, projection: Projection) -> Image:
        before, after = (p.pixels(self._far).astype(np.float32) for p in (self._still, projection))
        turn = cv2.getPerspectiveTransform(before, after)
        size = self._picture.shape[1], self._picture.shape[0]
        moved = cv2.warpPerspective(self._picture, turn, size, flags=cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return np.asarray(moved, np.float32)
