"""What one camera of the simulated hill sees: the image of every hill pulse."""

import numpy as np

from rig.images.pixels import Stored
from rig.pulse import HillPulse
from simrig.images import stamp
from simrig.images.board_view import BoardView
from simrig.images.live_view import LiveView
from simrig.images.still_view import StillView
from simrig.world.conditions.camera_motion import CameraMotion
from simrig.world.scenario import REFERENCE_WIDTH, Scenario

_FLAKE_HALF = 3  #: a flake is drawn in a square of 2 * 3 + 1 px
_FLAKE_GREY = 215.0


class CameraView:
    """Renders one camera's images. Deterministic: seed, camera and pulse decide every pixel.

    What the scenario does not ask for costs nothing. Not for use by two threads at once.

    Args:
        scenario: what there is to see.
        camera: index of the camera in the scenario.
        width: width of the image, px; the field of view is the same at every width.
        height: height of the image, px.
        rate_hz: rate of the pulses; hill pulse n shows scene time n / rate_hz, or a little later if it is exposed for
            some time.

        bits: of a pixel; white is 2**bits - 1.

    Raises:
        IndexError: the scenario has no such camera.
    """

    def __init__(self, scenario: Scenario, camera: int, width: int, height: int, rate_hz: float, bits: int = 8) -> None:
        self._stamped = camera if scenario.stamp else None
        self._rate_hz = rate_hz
        rng = np.random.default_rng((scenario.seed, camera, 99))
        self._view: StillView | LiveView | BoardView
        if scenario.board is not None:
            self._view = BoardView(scenario, scenario.board, camera, width, height, rate_hz, bits)
        elif _is_live(scenario, camera):
            self._view = LiveView(scenario, camera, width, height, rate_hz, bits)
        else:
            self._view = StillView(scenario, camera, width, height, rate_hz, rng, bits)
        self._snow = Snowfall(scenario.image.snow_flakes, width, height, rng, _FLAKE_GREY * 2.0 ** (bits - 8))

    def render_into(self, out: Stored, pulse: HillPulse) -> None:
        """Render the image of hill pulse `pulse` into `out`, shape (height, width); its rows may lie apart."""
        self._view.render_into(out, pulse)
        self._snow.draw(out, pulse / self._rate_hz)
        if self._stamped is not None:
            stamp.write(out, self._stamped, pulse)


def _is_live(scenario: Scenario, camera: int) -> bool:
    """Whether more than jumper and noise change in the images of this camera."""
    tables = scenario.light, scenario.weather, scenario.surroundings
    moving = not CameraMotion(scenario, camera).still
    return moving or any(table.changes for table in tables) or scenario.image.electrons_per_grey > 0


class Snowfall:
    """Snow flakes that fall at their own speeds and re-enter at the top; the same time gives the same flakes.

    Args:
        flakes: number of flakes.
        width: width of the image, px.
        height: height of the image, px.
        rng: decides where the flakes start and how they look.
        grey: of a flake.
    """

    def __init__(
        self, flakes: int, width: int, height: int, rng: np.random.Generator, grey: float = _FLAKE_GREY
    ) -> None:
        self._grey = grey
        self._size = np.array((width, height), float)
        self._start = rng.uniform(0, 1, (flakes, 2)) * self._size
        speed = np.stack((rng.normal(35, 20, flakes), rng.uniform(60, 190, flakes)), axis=1)
        self._speed = speed * width / REFERENCE_WIDTH
        self._variance = rng.uniform(0.5, 1.3, (flakes, 1)) ** 2
        self._strength = rng.uniform(0.2, 0.95, (flakes, 1, 1))
        self._steps = np.arange(-_FLAKE_HALF, _FLAKE_HALF + 1)

    def draw(self, image: Stored, time_s: float) -> None:
        """Draw the flakes of scene time `time_s` into `image` (h, w), in place."""
        if not len(self._start):
            return
        place = np.mod(self._start + self._speed * time_s, self._size - 2 * _FLAKE_HALF - 1) + _FLAKE_HALF
        pixel = place.astype(np.intp)
        columns = pixel[:, :1] + self._steps
        rows = pixel[:, 1:] + self._steps
        across = np.exp(-((columns - place[:, :1]) ** 2) / (2 * self._variance))
        down = np.exp(-((rows - place[:, 1:]) ** 2) / (2 * self._variance))
        cover = self._strength * down[:, :, None] * across[:, None, :]
        where = rows[:, :, None], columns[:, None, :]
        below = image[where]
        image[where] = below + cover * (self._grey - below)
