from pathlib import Path

import cv2
import numpy as np
import pytest

from analysis.film.contact_sheet import write_contact_sheet
from analysis.images.activity import busiest_pulse, liveliest_pulse
from recorder.log.triplet_buffers import TripletBuffers
from recorder.writing.log_writer import LogWriter
from rig.errors import BadInputError, LogDamagedError
from tests.recorder.logs import LOST, OK, START, acquire, make_tag, open_writer, write_log

SHAPE = (120, 480)
_PNG = b"\x89PNG\r\n\x1a\n"


def _write_scene(path: Path, pulses: int, moving: range, lost: range = range(0)) -> None:
    """Noise in which a bright spot crosses all cameras while `moving`; K2 is lost while `lost`."""
    rng = np.random.default_rng(7)
    buffers = TripletBuffers(SHAPE, 4)
    with open_writer(path, buffers) as log:
        for pulse in range(1, pulses + 1):
            slot = acquire(buffers)
            image = buffers.pixels(slot)
            image[:] = rng.normal(90, 3, SHAPE).clip(0, 255)
            if pulse in moving:
                column = 5 + (pulse - moving.start) * 130 // len(moving)
                for block in range(3):
                    image[50:62, block * 160 + column : block * 160 + column + 12] = 250
            statuses = (OK, LOST, OK) if pulse in lost else (OK, OK, OK)
            if pulse in lost:
                image[:, 160:320] = 0
            _write(log, slot, pulse, statuses)
    buffers.close()


def _write(log: LogWriter, slot: int, pulse: int, statuses: tuple[str, ...]) -> None:
    tag = make_tag(pulse, statuses, SHAPE)  # type: ignore[arg-type]
    log.write_pulse(tag, slot, START)


def test_the_pulses_shown_are_those_in_which_something_moves(tmp_path: Path) -> None:
    _write_scene(tmp_path / "log.mcap", 400, range(150, 180))
    pulses = write_contact_sheet(tmp_path / "log.mcap", tmp_path / "sheet.png")
    assert len(pulses) == 12
    assert pulses == sorted(set(pulses))
    assert 149 <= pulses[0] <= 153
    assert 176 <= pulses[-1] <= 180


def test_the_pulse_that_stands_for_a_recording_is_one_in_which_something_moves(tmp_path: Path) -> None:
    _write_scene(tmp_path / "log.mcap", 300, range(240, 270), lost=range(250, 256))
    assert liveliest_pulse(tmp_path / "log.mcap") in {*range(240, 250), *range(256, 270)}


def test_a_recording_opens_where_most_moves_and_at_its_beginning_where_nothing_does(tmp_path: Path) -> None:
    _write_scene(tmp_path / "jump.mcap", 300, range(240, 270), lost=range(20, 30))
    assert busiest_pulse(tmp_path / "jump.mcap") in range(240, 270)
    _write_scene(tmp_path / "calm.mcap", 60, range(0))
    assert busiest_pulse(tmp_path / "calm.mcap") is None


@pytest.mark.parametrize("pulses", [1, 2, 3])
def test_a_pulse_stands_for_a_short_recording_too(tmp_path: Path, pulses: int) -> None:
    _write_scene(tmp_path / "log.mcap", pulses, range(0))
    assert liveliest_pulse(tmp_path / "log.mcap") in range(1, pulses + 1)


def test_lost_frames_are_no_motion(tmp_path: Path) -> None:
    _write_scene(tmp_path / "log.mcap", 200, range(150, 180), lost=range(20, 60))
    pulses = write_contact_sheet(tmp_path / "log.mcap", tmp_path / "sheet.png")
    assert set(pulses) <= set(range(149, 181))


def test_where_nothing_moves_the_whole_log_is_shown(tmp_path: Path) -> None:
    _write_scene(tmp_path / "log.mcap", 100, range(0))
    pulses = write_contact_sheet(tmp_path / "log.mcap", tmp_path / "sheet.png", count=5)
    assert pulses[0] <= 10
    assert pulses[-1] >= 90


@pytest.mark.parametrize("pulses", [1, 2, 5, 12, 13])
def test_short_logs_are_shown_as_far_as_they_go(tmp_path: Path, pulses: int) -> None:
    _write_scene(tmp_path / "log.mcap", pulses, range(1, 3))
    shown = write_contact_sheet(tmp_path / "log.mcap", tmp_path / "sheet.png")
    assert shown == sorted(set(shown))
    assert len(shown) == min(pulses, 12)


def test_the_sheet_is_a_png_that_shows_the_images(tmp_path: Path) -> None:
    _write_scene(tmp_path / "log.mcap", 40, range(10, 30), lost=range(12, 14))
    write_contact_sheet(tmp_path / "log.mcap", tmp_path / "sheet.png", count=4)
    assert (tmp_path / "sheet.png").read_bytes().startswith(_PNG)
    sheet = cv2.imread(str(tmp_path / "sheet.png"))
    assert sheet is not None
    rows, columns, _ = sheet.shape
    assert columns == 2400
    assert 500 < rows < 1000
    assert np.count_nonzero((sheet > 80).all(axis=2) & (sheet < 100).all(axis=2)) > 0.4 * rows * columns  # background
    assert np.count_nonzero((sheet > 230).all(axis=2)) > 4 * 3 * 500  # the spot in every block, and the writing


def test_a_log_without_images_is_named(tmp_path: Path) -> None:
    write_log(tmp_path / "log.mcap", ((LOST,) * 3,) * 3)
    with pytest.raises(LogDamagedError, match="holds no image that could be shown"):
        write_contact_sheet(tmp_path / "log.mcap", tmp_path / "sheet.png")


def test_a_place_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    write_log(tmp_path / "log.mcap")
    with pytest.raises(BadInputError, match=r"nowhere/sheet\.png: cannot be written .*; choose another"):
        write_contact_sheet(tmp_path / "log.mcap", tmp_path / "nowhere" / "sheet.png")
