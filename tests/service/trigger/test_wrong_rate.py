"""A rig is not armed while pulses come at another rate than its file names."""

from collections.abc import Callable
from pathlib import Path

import pytest

from rig.clocks import host_now
from rig.phrase import plain
from rig.settings.model import RigSettings
from rig.settings.trigger import ExternalTrigger
from rig.transport.recorder_reports import CameraNews
from service.processes.seen import CameraPresence, Processes, Seen
from service.supervision.arming import why_not_armed
from simrig.programs.simulated_hill import SimulatedHill
from tests.capture.rigs import SCENARIO, make_rig, write_rig
from tests.support.commands import run_svev
from tests.support.loopback import Loopback
from triggering.timeline.steady_rate import SteadyRate

HERE = CameraPresence(CameraNews.CONNECTED, plain("a camera"))


def _measured(rig: RigSettings, rate: SteadyRate | None) -> str:
    seen = Seen(Processes.ALL, cameras=(HERE,) * len(rig.cameras), rate=rate)
    fault = why_not_armed(rig, seen, len(rig.cameras))
    return "" if fault is None else fault.text


def _unnamed(rig: RigSettings) -> RigSettings:
    return rig.model_copy(update={"trigger": ExternalTrigger(settle_s=5.0)})


@pytest.mark.parametrize(
    ("change", "rate", "said"),
    [
        (None, SteadyRate(36.0, 0.0125), "not armed: pulses come at 36.0 Hz, the rig file says rate_hz = 30"),
        (None, SteadyRate(30.3, 0.0125), ""),
        (None, None, ""),
        (_unnamed, SteadyRate(36.0, 0.0125), ""),
    ],
    ids=["another rate", "nearly the rate", "a generator that stands still", "a rig file without a rate"],
)
def test_what_is_refused(
    tmp_path: Path,
    loopback: Loopback,
    change: Callable[[RigSettings], RigSettings] | None,
    rate: SteadyRate | None,
    said: str,
) -> None:
    rig = make_rig(tmp_path, "sim", loopback)
    assert _measured(change(rig) if change else rig, rate) == said


def test_pulses_of_our_own_making_are_never_refused(tmp_path: Path, loopback: Loopback) -> None:
    """Cameras that cannot keep up are no wrong rate."""
    assert _measured(make_rig(tmp_path, "aravis", loopback, source="software"), SteadyRate(25.0, 0.0)) == ""


def test_a_recording_does_not_begin_at_another_rate(tmp_path: Path, loopback: Loopback) -> None:
    path = write_rig(tmp_path, "aravis", loopback, rate_hz=30.0, names=("K1",))
    text = path.read_text().replace('[simulation]\nscenario = "scenario.toml"\n', "")
    path.write_text(text)
    out = str(tmp_path / "logs")
    with SimulatedHill(SCENARIO, {"K1": loopback.cameras(1)[0]}, 36.0, epoch=host_now(), test_pattern=True):
        done = run_svev("record", "--rig", str(path), "--seconds", "1", "--out", out, timeout_s=90)
    assert done.returncode == 2, done.stderr
    assert "not armed: pulses come at 36.0 Hz, the rig file says rate_hz = 30: set the generator right" in done.stderr
    assert not list(tmp_path.glob("logs/*.mcap"))
