"""A calibration put into the rig file of an idle service: cameras that it lacks keep theirs, or it is refused."""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from rig.errors import BadInputError
from rig.settings.file import load_rig
from rig.transport.recorder_commands import RecorderOptions
from service.calibrating.saving import CalibrationKeeper
from service.status.event_hub import EventHub
from service.supervision.supervisor import Supervisor
from tests.capture.rigs import write_rig
from tests.service.recordings.test_calibration import CAMERA
from tests.service.serving import PATIENCE_S
from tests.support.loopback import Loopback


def _result(path: Path, names: Sequence[str], c: float) -> Path:
    cameras = {name: CAMERA | {"c": c} for name in names}
    path.write_text(json.dumps({"format": "svev-adjustment/1", "converged": True, "cameras": cameras}))
    return path


@pytest.fixture
def supervisor(tmp_path: Path, loopback: Loopback) -> Iterator[Supervisor]:
    path = write_rig(tmp_path, "sim", loopback)
    (tmp_path / "data").mkdir()
    hub = EventHub(lambda _: None)
    options = RecorderOptions(directory=tmp_path / "data")
    made = Supervisor(load_rig(path), path.read_text(), hub, options)
    made.start()
    yield made
    made.stop(PATIENCE_S)


def test_cameras_that_it_lacks_keep_the_calibration_before(tmp_path: Path, supervisor: Supervisor) -> None:
    rig = next(tmp_path.glob("*rig*.toml"))
    keep = CalibrationKeeper(supervisor, rig)
    new = _result(tmp_path / "data" / "calibration.json", ["K2"], 1300.0)
    before = rig.read_text()
    with pytest.raises(BadInputError, match="lacks camera K1 of the rig"):
        keep(new)
    assert (rig.read_text(), supervisor.rig.calibration) == (before, None)
    first = _result(tmp_path / "first.json", ["K1", "K2", "K3"], 1200.0)
    keep(first)
    assert load_rig(rig).calibration == supervisor.rig.calibration == first
    keep(new)
    joined = load_rig(rig).calibration
    assert joined == supervisor.rig.calibration == new.with_name("joined.json")
    cameras = json.loads(joined.read_text())["cameras"]
    assert {name: camera["c"] for name, camera in cameras.items()} == {"K1": 1200.0, "K2": 1300.0, "K3": 1200.0}
    assert supervisor.now.in_use.toml == rig.read_text()
    assert [event.code for event in supervisor.hub.after(0)].count("event_calibration") == 2
