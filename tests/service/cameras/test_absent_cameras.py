"""Cameras that are absent, disappear and come back: the service goes on with the others, and says so."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from rig.clocks import host_now
from rig.settings.file import load_rig
from service.processes.simulation import simulated_hill
from simrig.programs.simulated_hill import SimulatedHill
from tests.capture.rigs import write_rig
from tests.service.serving import Serving, serving
from tests.support.loopback import Loopback
from tests.support.reliability import FaultTable

pytestmark = pytest.mark.long


@contextmanager
def _hill_and_service(
    folder: Path, loopback: Loopback, *absent: str, least: int
) -> Iterator[tuple[SimulatedHill, Serving]]:
    """Simulated cameras that the test can unplug, and a service that treats them as real ones."""
    rig = write_rig(folder, "aravis", loopback)
    rig.write_text(rig.read_text().replace("[trigger]\n", f"[trigger]\nmin_cameras = {least}\n"))
    with simulated_hill(load_rig(rig), host_now()) as hill:
        assert isinstance(hill, SimulatedHill)
        for name in absent:
            hill.kill(name)
        rig.write_text(rig.read_text().replace('[simulation]\nscenario = "scenario.toml"\n', ""))
        with serving(folder, rig, loopback) as service:
            yield hill, service


def test_two_of_three_cameras_record_and_the_third_joins_in(
    tmp_path: Path, loopback: Loopback, fault_table: FaultTable
) -> None:
    with _hill_and_service(tmp_path, loopback, "K2", least=2) as (hill, service):
        service.arm()
        status = service.await_cameras("ready", "absent", "ready")
        assert status["statement"]["code"] in {"state_armed_partly", "state_waiting_partly"}
        assert status["statement"]["level"] == "warning"
        assert "without K2" in status["statement"]["text"]
        assert "check its power and cable" in status["cameras"][1]["statement"]["advice"]
        examined = [found for found in service.get("/api/doctor")["findings"] if found["topic"] == "cameras"]
        assert [found["level"] for found in examined if "K2" in found["what"]] == ["FAIL"]
        recording = service.post("/api/recordings", {"preroll_s": 0})
        service.await_pulses(30)
        ended = service.post(f"/api/recordings/{recording['id']}/stop")
        assert ended["counts"]["causes"]["absent"] == ended["counts"]["pulses"] == ended["counts"]["partial"]
        hill.restart("K2")
        assert service.await_cameras("ready", "ready", "ready")["state"] == "armed"
    said = (
        f"{status['cameras'][1]['statement']['text'].partition(':')[0]}; {status['cameras'][1]['statement']['advice']}"
    )
    fault_table.tell(
        "Cameras and pulses", "one of three cameras is not there", lost="none: its frames, absent", said=said
    )


def test_a_rig_that_loses_all_cameras_is_armed_again_when_enough_are_back(
    tmp_path: Path, loopback: Loopback, fault_table: FaultTable
) -> None:
    with _hill_and_service(tmp_path, loopback, "K3", least=2) as (hill, service):
        service.arm()
        hill.kill("K1")
        hill.kill("K2")
        fault = service.await_state("fault")["statement"]
        assert fault["code"] == "fault_no_camera"
        hill.restart("K2")
        status = service.await_cameras("absent", "ready", "absent")
        assert status["state"] == "fault", "one is too few; what follows from it is a table in service/supervision"
        assert service.call("POST", "/api/recordings")[0] == 409
        hill.restart("K1")
        status = service.await_state("armed")
        assert status["statement"]["code"] in {"state_armed_partly", "state_waiting_partly"}
    said = f"{fault['text']}; {fault['advice']}"
    fault_table.tell("Cameras and pulses", "all cameras go while the rig is armed", lost="-", said=said)
