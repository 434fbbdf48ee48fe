from pathlib import Path

import pytest

from recorder.reading.info import info
from tests.recorder.logs import ABSENT, ALL_OK, LOST, OK, PERIOD_NS, RIG, SESSION, START, write_log


def test_a_log_says_what_it_is(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    write_log(path, (ALL_OK, (OK, LOST, OK), (ABSENT,) * 3, ALL_OK))
    found = info(path)
    assert (found.closed, found.damaged_bytes) == (True, 0)
    data = found.to_json()
    assert data.pop("rate_hz") == pytest.approx(30, abs=1e-4)
    assert data.pop("duration_s") == pytest.approx(3 * PERIOD_NS / 1e9, abs=1e-6)
    assert data.pop("library").startswith("svev ")
    assert data == {
        "log": str(path), "closed": True, "truncated": False, "damaged_bytes": 0,
        "pulses": 4, "complete": 2, "partial": 2,
        "causes": {"lost": 1, "missed": 0, "damaged": 0, "absent": 3}, "missing_pulses": 0, "pauses": [],
        "merged": {}, "trouble": "", "ended_early": "", "being_written": False,
        "part": 1, "part_before": "", "part_after": "",
        "bytes": path.stat().st_size, "recording": "r1", "start_ns": str(START + PERIOD_NS),
        "offset_us": {"median": 0.5, "max": 1.5}, "shape": [24, 90], "cameras": ["K1", "K2", "K3"],
        "ledger": {
            "K1": {"ok": 3, "lost": 0, "missed": 0, "damaged": 0, "absent": 1},
            "K2": {"ok": 2, "lost": 1, "missed": 0, "damaged": 0, "absent": 1},
            "K3": {"ok": 3, "lost": 0, "missed": 0, "damaged": 0, "absent": 1},
        },
        "utc": None, "source": None, "session": SESSION, "rig": RIG, "imported": {}, "compacted": {},
        "messages": {"/events": 2, "/triplet": 3, "/triplet/tag": 4, "/health": 1},
    }  # fmt: skip


def test_a_log_without_a_pulse_says_so(tmp_path: Path) -> None:
    write_log(tmp_path / "log.mcap", ())
    found = info(tmp_path / "log.mcap").to_json()
    assert (found["pulses"], found["duration_s"], found["rate_hz"], found["offset_us"]) == (0, 0.0, None, None)
    assert (found["recording"], found["start_ns"], found["shape"], found["cameras"]) == ("", None, None, [])


def test_a_log_that_was_not_closed_says_so(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    write_log(path, (ALL_OK,) * 3)
    data = path.read_bytes()
    path.write_bytes(data[: data.index(b'{"pulse":3,')])
    found = info(path)
    assert not found.closed
    assert found.session == SESSION
    assert found.ledger.pulses == 2


def test_pixels_are_not_read(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    written = write_log(path, (ALL_OK,) * 3, (480, 1920))
    image = written[1].image
    assert image is not None
    # Where the pixels are, the file becomes a hole: the tags around it are enough.
    data = path.read_bytes()
    start = data.find(image.tobytes())
    path.write_bytes(data[: start + 4096] + bytes(image.size - 4096) + data[start + image.size :])
    assert info(path).ledger.complete == 3
