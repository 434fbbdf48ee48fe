"""The motion detector on rendered images: every jump, and nothing else."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from rig.pulse import HillPulse
from rig.settings.file import CONFIG
from service.automatic.motion import MotionDetector
from simrig.images.view import CameraView
from simrig.world.scenario import load_scenario
from tests.support.repeats import repeats

RATE_HZ, EVERY = 30.0, 3  # ten images a second, as the service looks
SHARE = 0.004


def found(folder: Path, base: str, camera: int, seconds: float, more: str = "") -> Iterator[float]:
    """Scene times at which something moves, s."""
    path = folder / "scenario.toml"
    path.write_text(f'base = "{CONFIG}/scenarios/{base}.toml"\nname = "motion"\n{more}\n')
    view = CameraView(load_scenario(path), camera, 640, 480, RATE_HZ)
    detector, image = MotionDetector(SHARE), np.zeros((480, 640), np.uint8)
    for pulse in range(0, round(seconds * RATE_HZ), EVERY):
        view.render_into(image, HillPulse(pulse))
        if detector.look(image, pulse / RATE_HZ):
            yield pulse / RATE_HZ


@pytest.mark.parametrize(("base", "camera"), repeats([("training", 0), ("training", 2), ("hard", 0)], quick=2))
def test_every_jump_is_found_and_nothing_between(tmp_path: Path, base: str, camera: int) -> None:
    every_s, jumps = 4.0, 5
    times = list(found(tmp_path, base, camera, (jumps + 1) * every_s))
    assert {int(time // every_s) for time in times} == set(range(1, jumps + 1))
    assert {0.8 <= time % every_s <= 2.3 for time in times} == {True}  # the jumper is in sight then


WEATHER = {
    "dense snow": "jump_every_s = 1e6\n[weather]\nsnowfall = 1.0\nlens_snow = 10",
    "clouds": "jump_every_s = 1e6\n[light]\ncloud_depth = 0.5\ncloud_period_s = 4.0",
}


@pytest.mark.parametrize("weather", repeats(WEATHER))
def test_snow_light_trees_and_spectators_begin_nothing(tmp_path: Path, weather: str) -> None:
    assert list(found(tmp_path, "hard", 0, 25.0, WEATHER[weather])) == []


def test_a_lamp_and_what_stays_begin_nothing_but_somebody_who_walks_does() -> None:
    rng, detector = np.random.default_rng(1), MotionDetector(SHARE)
    scene = rng.uniform(40, 160, (480, 640))
    times = []
    for step in range(200):
        image = scene + rng.normal(0, 2, scene.shape)
        if step >= 60:
            image[100:220, 100:220] += 80  # a lamp goes on, and stays on
        if 120 <= step < 130:
            left = 300 + 12 * (step - 120)
            image[200:290, left : left + 50] = 20
        if detector.look(np.clip(image, 0, 255).astype(np.uint8), step / 10):
            times.append(step)
    assert times
    assert set(times) <= set(range(121, 132))
