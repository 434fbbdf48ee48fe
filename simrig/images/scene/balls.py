"""Draws the signalised points: reflective handballs on black plates, on thin poles."""

import numpy as np

from rig.arrays import Floats
from simrig.images.scene.drawing import Blob, Image, stroke
from simrig.images.scene.shaded_ball import ShadedBall
from simrig.world.projection import Projection
from simrig.world.scenario import BRIGHTEST, Ball, Scenario

PLATE = 36.0  #: radiance of the black plates behind the balls
PLATE_MARGIN_PX = 5.0  #: width of the plate around the image of a ball
_POLE = 92.0
_SNOW = 165.0
_MOUND = 1.2  #: radius of the snow in front of a ball, in radii of its plate
_NEAREST_M = 2.0


def put_poles(image: Image, scenario: Scenario, projection: Projection) -> None:
    """Draw the poles into an image, far ones first, in place."""
    for _, ball in _far_first(scenario, projection):
        x, y, z = ball.X
        top, foot = projection.pixels([(x, y, z), (x, y, min(float(scenario.hill.snow(x, y)), z))])
        stroke(image, top, foot, 0.4, 0.4, _POLE)


class Balls:
    """Draws the balls of one camera.

    Args:
        scenario: says where they are, and how much snow is in front of them.
        projection: the camera as it was set up.
    """

    def __init__(self, scenario: Scenario, projection: Projection) -> None:
        self._projection = projection
        blur = scenario.image.blur_sigma_px
        self._balls: list[tuple[Ball, float, Blob, Blob]] = []
        self._shaded: dict[str, ShadedBall] = {}
        sun = scenario.light.sun
        for distance, ball in _far_first(scenario, projection):
            radius = scenario.ball_radius_m * projection.c / distance
            self._balls.append((ball, radius, Blob(radius + PLATE_MARGIN_PX, blur), Blob(radius, blur)))
            if sun is not None:
                centre = np.array(ball.X, float)
                self._shaded[ball.name] = ShadedBall(sun, centre, scenario.ball_radius_m, blur, BRIGHTEST)
        self._sprites: list[tuple[slice, slice, Image, Image]] | None = None

    def draw(self, image: Image, projection: Projection) -> None:
        """Draw the balls into an image of radiance, shape (h, w), in place, at their exact places."""
        if not self._balls:
            return
        places = projection.pixels([ball.X for ball, *_ in self._balls])
        for (ball, radius, plate, disc), (x, y) in zip(self._balls, places, strict=True):
            plate.draw(image, x, y, PLATE)
            if ball.name in self._shaded:
                self._shaded[ball.name].draw(image, projection)
            else:
                disc.draw(image, x, y, BRIGHTEST)
            if ball.covered:
                _cover(image, x, y, radius, ball.covered)

    def paste(self, image: Image) -> None:
        """Draw the balls of a camera that stands still: the same as `draw`, but much faster from the second time on."""
        if self._sprites is None:
            self._sprites = self._prepared(image.shape)
        for rows, columns, keep, add in self._sprites:
            window = image[rows, columns]
            window *= keep
            window += add

    def _prepared(self, shape: tuple[int, ...]) -> list[tuple[slice, slice, Image, Image]]:
        """Drawing is linear in what is behind: its effect on 0 and on 1 is its effect on everything."""
        add, one = np.zeros(shape, np.float32), np.ones(shape, np.float32)
        self.draw(add, self._projection)
        self.draw(one, self._projection)
        sprites = []
        for ball, radius, plate, _ in self._balls:
            x, y = self._projection.pixels(ball.X)
            reach = plate.reach_px + (2 * _mound(radius) if ball.covered else 0.0)
            rows, columns = _span(y - reach, y + reach, shape[0]), _span(x - reach, x + reach, shape[1])
            keep = one[rows, columns] - add[rows, columns]
            sprites.append((rows, columns, keep, add[rows, columns].copy()))
            add[rows, columns], one[rows, columns] = 0, 1  # a window that overlaps must not repeat this ball
        return sprites


def _cover(image: Image, x: float, y: float, radius: float, share: float) -> None:
    """Heap snow in front of the lower `share` of a ball, up to a level border."""
    mound = _mound(radius)
    middle = y + radius - 2 * radius * share + mound
    aside: Floats = np.array((0.5 * mound, 0.0))
    place = np.array((x, middle))
    stroke(image, place - aside, place + aside, mound, mound, _SNOW)


def _mound(radius: float) -> float:
    """Radius, px, of the snow in front of a ball of this radius."""
    return _MOUND * (radius + PLATE_MARGIN_PX)


def _far_first(scenario: Scenario, projection: Projection) -> list[tuple[float, Ball]]:
    seen = [(float(projection.distance(ball.X)), ball) for ball in scenario.balls if not ball.gone]
    return sorted(
        ((d, ball) for d, ball in seen if d > _NEAREST_M), key=lambda pair: (pair[0], pair[1].X), reverse=True
    )


def _span(first: float, last: float, size: int) -> slice:
    return slice(min(size, max(0, int(first))), min(size, max(0, int(last) + 1)))
