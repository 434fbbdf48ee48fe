"""A recording that is made while somebody calibrates has the processor: the helper stands still, then goes on."""

import os
from http import HTTPStatus
from pathlib import Path
from typing import Any, Final

import pytest

from rig.settings.file import CONFIG
from tests.service.serving import Serving, serving
from tests.support.loopback import Loopback
from tests.support.processes import TOKEN_VARIABLE, own_processes
from tests.support.waiting import wait_until

_PULSES: Final = 60
_PATIENCE_S: Final = 120.0
#: Ticks of 10 ms that the helper's program may use after a recording began, in six seconds: it is stopped within two.
_STILL: Final = 4
#: Ticks after which it is in the middle of its work, which are a hundred or more.
_AT_WORK: Final = 45


def _board_rig(folder: Path, loopback: Loopback) -> Path:
    """Two cameras that see the board in one pose after the other."""
    scenario = CONFIG / "scenarios" / "calibration.toml"
    (folder / "scenario.toml").write_text(f'base = "{scenario}"\n[board]\nstill_s = 3.0\nmoving_s = 0.3\n')
    rig = folder / "rig.toml"
    rig.write_text(
        'name = "board"\n[trigger]\nrate_hz = 10.0\n[simulation]\nscenario = "scenario.toml"\n'
        f'[network]\npublish = "{loopback.endpoint()}"\n'
        + "".join(f'[[cameras]]\nname = "{name}"\nbackend = "sim"\n' for name in ("K2", "K3"))
    )
    return rig


def _await_helper(service: Serving, state: str, taken: int = 0) -> dict[str, Any]:
    def so() -> bool:
        view = service.get("/api/calibration")
        return bool(view["state"] == state and view["taken"] >= taken)

    wait_until(so, f"the helper is {state} with {taken} pictures", _PATIENCE_S, 0.05)
    view: dict[str, Any] = service.get("/api/calibration")
    return view


def _programs() -> list[int]:
    """Processor time of the helper's program, in ticks of 10 ms; empty: it is being started."""
    own = own_processes(os.environ[TOKEN_VARIABLE])
    return [each.cpu_ticks for each in own if "service.calibrating." in each.command]


def _ticks() -> int:
    """The same of the one that runs."""
    (ticks,) = _programs()
    return ticks


def _record(service: Serving) -> None:
    """A recording during which the helper stands still, from its first moment on."""
    wait_until(lambda: max(_programs(), default=0) > _AT_WORK, "it is at work", _PATIENCE_S, 0.05)
    recording = service.post("/api/recordings")["id"]
    used = _ticks()
    held = _await_helper(service, "held")
    service.await_pulses(_PULSES)
    assert _ticks() - used < _STILL
    assert service.get("/api/calibration")["taken"] == held["taken"]
    service.post(f"/api/recordings/{recording}/stop")
    service.await_state("armed")


@pytest.mark.long
@pytest.mark.timeout(400)
def test_the_helper_stands_still_while_a_recording_runs(tmp_path: Path, loopback: Loopback) -> None:
    with serving(tmp_path, _board_rig(tmp_path, loopback), loopback) as service:
        service.arm()
        service.post("/api/calibration", {})
        _await_helper(service, "looking", taken=2)
        _record(service)
        _await_helper(service, "looking", taken=8)
        assert service.call("POST", "/api/calibration/compute")[0] == HTTPStatus.ACCEPTED
        _record(service)
        _await_helper(service, "computing")
        service.call("DELETE", "/api/calibration")
