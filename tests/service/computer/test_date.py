"""A date that cannot be right is told by the service at its start, before recordings are named by it."""

import os
import time
from pathlib import Path

import pytest

from tests.service.serving import PATIENCE_S, Serving, serving
from tests.support.loopback import Loopback
from tests.support.rigs import write_rig
from tests.support.waiting import wait_until


@pytest.mark.long
def test_a_recording_of_a_later_year_makes_the_date_doubtful(tmp_path: Path, loopback: Loopback) -> None:
    rig = write_rig(tmp_path, loopback, backend="sim")
    (data := tmp_path / "data").mkdir()
    (log := data / "2036-01-01T00-00-00Z.mcap").write_bytes(b"")
    with serving(tmp_path, rig, loopback, data=data) as service:
        service.await_state("idle")
        assert _told(service) == []
    next_year = time.time() + 366 * 86_400
    os.utime(log, (next_year, next_year))
    with serving(tmp_path, rig, loopback, data=data) as service:
        wait_until(lambda: bool(_told(service)), "the date is doubted", PATIENCE_S)
        (line,) = _told(service)
        assert f"and {log} was written on {time.strftime('%Y-%m-%d', time.localtime(next_year))}" in line
        assert "one of the two dates is wrong" in line


def _told(service: Serving) -> list[str]:
    return [line for line in service.log.read_text().splitlines() if "the clock says" in line]
