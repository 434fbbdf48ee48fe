"""The static image of a log and its noise."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from analysis.scene.static_image import static_image, static_images
from recorder.log.triplet_buffers import TripletBuffers
from rig.arrays import Floats
from rig.errors import BadInputError, LogDamagedError
from rig.frame import FrameStatus
from tests.recorder.logs import ALL_OK, LOST, OK, START, acquire, make_tag, open_writer, write_log

Grey = NDArray[np.uint8]

ROWS, COLUMNS = 60, 80


def _scene() -> Floats:
    y, x = np.mgrid[:ROWS, :COLUMNS]
    return np.asarray(40.0 + x + 0.5 * y)


def _frames(count: int, sigma: float, seed: int = 3) -> list[Grey]:
    rng = np.random.default_rng(seed)
    return [np.rint(_scene() + rng.normal(0, sigma, (ROWS, COLUMNS))).astype(np.uint8) for _ in range(count)]


def _write_log(path: Path, frames: list[Grey], statuses: Sequence[Sequence[FrameStatus]]) -> None:
    """Every camera sees the same frames, K2 brighter by 20."""
    shape = (ROWS, 3 * COLUMNS)
    buffers = TripletBuffers(shape, 4)
    with open_writer(path, buffers) as log:
        for pulse, (frame, status) in enumerate(zip(frames, statuses, strict=True), 1):
            slot = acquire(buffers)
            image = buffers.pixels(slot)
            for block in range(3):
                there = frame + np.uint8(20 * (block == 1)) if status[block] is OK else 0
                image[:, block * COLUMNS : (block + 1) * COLUMNS] = there
            log.write_pulse(make_tag(pulse, status, shape), slot, START)
    buffers.close()


def test_grey_values_and_noise_are_those_of_the_scene() -> None:
    image = static_image("K1", _frames(31, 2.0))
    assert image.frames == 31
    error = image.grey - _scene()
    assert np.median(image.noise) == pytest.approx(2.0, rel=0.05)
    assert float(np.mean((error / image.sigma) ** 2)) == pytest.approx(1.0, abs=0.1)


def test_grey_values_of_more_than_eight_bits_are_finer() -> None:
    """Fractions of a grey level, as 12 bits give them: noise below one level is found as it is."""
    rng = np.random.default_rng(3)
    fine = [np.rint(16 * (_scene() + rng.normal(0, 0.6, (ROWS, COLUMNS)))) / 16 for _ in range(31)]
    image = static_image("K1", [frame.astype(np.float32) for frame in fine])
    error = image.grey - _scene()
    assert np.median(image.noise) == pytest.approx(0.6, rel=0.05)
    assert float(np.mean((error / image.sigma) ** 2)) == pytest.approx(1.0, abs=0.1)


def test_noise_that_grows_with_the_light_is_found() -> None:
    rng = np.random.default_rng(5)
    scene = np.tile(np.linspace(20, 220, 200), (100, 1))
    sigma = np.sqrt(1.0 + 0.05 * scene)
    frames = [np.rint(scene + sigma * rng.standard_normal(scene.shape)).astype(np.uint8) for _ in range(21)]
    image = static_image("K1", frames)
    for column in (10, 100, 190):
        assert np.median(image.noise[:, column - 8 : column + 8]) == pytest.approx(sigma[0, column], rel=0.08)


def test_what_moves_through_is_not_there() -> None:
    frames = _frames(15, 1.5)
    for i, frame in enumerate(frames):
        frame[20:40, 5 * i : 5 * i + 9] = 255
    error = static_image("K1", frames).grey - _scene()
    assert np.abs(error).max() < 3.0


@pytest.mark.parametrize("states", [2, 3])
def test_a_pixel_that_scatters_more_keeps_its_own_noise(states: int) -> None:
    frames = _frames(25, 1.5)
    for i, frame in enumerate(frames):
        frame[10:20, 10:20] = 60 + 40 * (i % states)
    noise = static_image("K1", frames).noise
    assert noise[12:18, 12:18].min() > 10
    assert np.median(noise[30:, 30:]) == pytest.approx(1.5, rel=0.1)


def test_a_frame_that_repeats_another_is_not_counted_twice() -> None:
    frames = _frames(6, 2.0)
    repeated = [frames[i % 6].copy() for i in range(30)]
    for i, frame in enumerate(repeated):
        frame[:3, i : i + 3] = 200  # something small moves in it
    image = static_image("K1", repeated)
    assert image.frames == 6
    assert float(np.mean(((image.grey - _scene())[5:] / image.sigma[5:]) ** 2)) == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize("count", [1, 2])
def test_few_frames_give_their_noise_too(count: int) -> None:
    image = static_image("K1", _frames(count, 3.0))
    assert np.median(image.noise) == pytest.approx(3.0, rel=0.1)


def test_blocks_that_did_not_come_are_left_out(tmp_path: Path) -> None:
    statuses = [(OK, LOST if pulse % 3 else OK, OK) for pulse in range(60)]
    _write_log(tmp_path / "log.mcap", _frames(60, 2.0), statuses)
    images = static_images(tmp_path / "log.mcap")
    assert list(images) == ["K1", "K2", "K3"]
    assert [image.frames for image in images.values()] == [31, 20, 31]
    for name, image in images.items():
        assert image.size == (COLUMNS, ROWS)
        assert np.abs(image.grey - _scene() - 20 * (name == "K2")).max() < 3.0


def test_a_camera_without_frames_has_no_image(tmp_path: Path) -> None:
    _write_log(tmp_path / "log.mcap", _frames(5, 2.0), [(OK, LOST, OK)] * 5)
    assert list(static_images(tmp_path / "log.mcap")) == ["K1", "K3"]


def test_part_of_a_log_can_be_asked_for(tmp_path: Path) -> None:
    frames = _frames(40, 1.0)
    frames[20:] = [frame + np.uint8(30) for frame in frames[20:]]
    _write_log(tmp_path / "log.mcap", frames, [ALL_OK] * 40)
    first, second = (static_images(tmp_path / "log.mcap", pulses)["K1"] for pulses in (range(1, 21), range(21, 41)))
    assert np.median(second.grey - first.grey) == pytest.approx(30, abs=0.5)


def test_a_log_without_images_is_named(tmp_path: Path) -> None:
    write_log(tmp_path / "log.mcap", ((LOST,) * 3,) * 3)
    with pytest.raises(LogDamagedError, match="holds no image that could be measured"):
        static_images(tmp_path / "log.mcap")
    with pytest.raises(BadInputError, match="no such file"):
        static_images(tmp_path / "none.mcap")
