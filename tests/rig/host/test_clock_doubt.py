"""What speaks against the date of the computer: files from after it, and an installation long before it or after it."""

import os
import time
from pathlib import Path

import pytest

from rig.host import clock_doubt as module
from rig.host.clock_doubt import clock_doubt

_DAY_S = 86_400.0
_YEAR_S = 365.25 * _DAY_S


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> "Clock":
    return Clock(monkeypatch)


class Clock:
    """The clock, set by a test."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self._monkeypatch, self._now = monkeypatch, time.time()

    def is_ahead(self, seconds: float, *, synchronized: bool) -> None:
        self._monkeypatch.setattr(time, "time", lambda: self._now + seconds)
        self._monkeypatch.setattr(module, "is_synchronized", lambda: synchronized)


def _written(path: Path, ahead_s: float) -> Path:
    path.write_bytes(b"")
    os.utime(path, (time.time() + ahead_s,) * 2)
    return path


@pytest.mark.parametrize(
    ("ahead_s", "synchronized", "words"),
    [
        (0.0, False, None),
        (3 * _YEAR_S, False, None),
        (10 * _YEAR_S, True, None),
        (10 * _YEAR_S, False, "years after this program was installed"),
        (-3 * _YEAR_S, True, "which is before this program was installed"),
        (-0.5 * _DAY_S, False, None),
    ],
)
def test_the_installation_tells(clock: Clock, ahead_s: float, synchronized: bool, words: str | None) -> None:
    clock.is_ahead(ahead_s, synchronized=synchronized)
    doubt = clock_doubt()
    assert doubt is None if words is None else doubt is not None and words in doubt.text


def test_a_file_that_was_written_later_than_now_tells(tmp_path: Path, clock: Clock) -> None:
    early, late = _written(tmp_path / "early.mcap", -_DAY_S), _written(tmp_path / "late.mcap", 2 * _YEAR_S)
    clock.is_ahead(0.0, synchronized=True)
    assert clock_doubt([early, tmp_path / "nothing"]) is None
    doubt = clock_doubt([early, late, tmp_path / "nothing"])
    assert doubt is not None
    assert f"{late} was written on {time.gmtime().tm_year + 2}" in doubt.text
    assert doubt.text.endswith("one of the two dates is wrong")


def test_a_file_of_another_zone_says_nothing(tmp_path: Path, clock: Clock) -> None:
    clock.is_ahead(0.0, synchronized=True)
    assert clock_doubt([_written(tmp_path / "zone.mcap", 0.6 * _DAY_S)]) is None


def test_a_date_beyond_all_calendars_is_said_all_the_same(tmp_path: Path, clock: Clock) -> None:
    clock.is_ahead(0.0, synchronized=True)
    file = tmp_path / "never.mcap"
    file.write_bytes(b"")
    os.utime(file, ns=((1 << 62), (1 << 62)))
    doubt = clock_doubt([file])
    assert doubt is not None
    assert "was written on 2116" in doubt.text
