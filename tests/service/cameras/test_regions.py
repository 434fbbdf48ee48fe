"""The region of a camera changed while the rig is armed: real Aravis and simulated cameras, whose sensor stays."""

import json
import tomllib
from pathlib import Path
from typing import Final

import numpy as np
import pytest

from analysis.procedure.log_facts import log_facts
from photogrammetry.geometry.camera_model import INTERIOR
from recorder.reading.log_reader import LogReader
from recorder.reading.triplets import triplets
from rig.api.status import State
from rig.arrays import Floats
from rig.errors import BadInputError
from rig.settings.camera import Region
from rig.settings.file import load_rig
from rig.settings.model import RigSettings
from rig.topics import RIG_ATTACHMENT
from rig.transport.recorder_commands import RecorderOptions
from service.regions import Regions
from service.status.event_hub import EventHub
from service.supervision.messages import Arm
from service.supervision.supervisor import Supervisor
from tests.capture.rigs import write_rig
from tests.service.serving import PATIENCE_S, Serving, serving
from tests.support.loopback import Loopback
from tests.support.stamps import hill_pulses
from tests.support.waiting import wait_until

K1: Final = "/api/cameras/K1"
WHOLE: Final = {"x": 0, "y": 0, "width": 640, "height": 480}
PART: Final = {"x": 160, "y": 96, "width": 320, "height": 240}
#: Scatter of a grey value in the mean of so few frames, in which a jumper may pass by.
_GREY: Final = 3.0


def test_a_camera_reads_out_another_region_and_the_rig_is_armed_anew(tmp_path: Path, loopback: Loopback) -> None:
    path = write_rig(tmp_path, "aravis", loopback, names=["K1", "K2"])
    lens = dict.fromkeys((*INTERIOR, "r0"), 0.0) | {"c": 1419.7, "distortion": "projected"}
    poses = {"format": "svev-adjustment/1", "converged": True, "cameras": {"K1": lens, "K2": lens}}
    (tmp_path / "poses.json").write_text(json.dumps(poses))
    path.write_text(first := f'calibration = "poses.json"\n{path.read_text()}')
    with serving(tmp_path, path, loopback) as service:
        assert service.get(K1)["limits"] is None  # it was not connected yet
        service.arm()
        told = service.get(K1)
        assert (told["region"], told["calibration"], told["saved"]) == (WHOLE, None, True)
        assert (told["limits"]["width"], told["limits"]["height"]) == (640, 480)
        status, answer = service.call("PATCH", K1, {"region": PART | {"x": 328}})
        assert (status, "640 x 480 px, and no region of 320 x 240 px from 328, 96" in answer["detail"]) == (422, True)
        assert service.state() == "armed"
        before = _recorded(service)
        recording = service.post("/api/recordings")["id"]
        status, answer = service.call("PATCH", K1, {"region": PART})
        assert (status, "stop it, then change the region" in answer["detail"]) == (409, True)
        service.post(f"/api/recordings/{recording}/stop", {"confirm": True})

        status, answer = service.call("PATCH", K1, {"region": PART, "exposure_us": 1500})
        assert (status, answer["region"], answer["exposure_us"], answer["saved"]) == (200, PART, 1500, False), answer
        unfit = "K1 was calibrated with 640 x 480 px from 0, 0, and reads out 320 x 240 px from 160, 96"
        assert answer["calibration"]["text"].endswith(unfit)
        service.await_state("armed")
        service.await_cameras("ready", "ready")
        after = _recorded(service)
        assert path.read_text() == first
        assert service.call("PATCH", K1, {"save": True})[1]["saved"] is True
        kept = load_rig(path)
        back = service.call("PATCH", K1, {"region": WHOLE, "save": True})[1]
        assert (back["region"], back["calibration"], back["saved"]) == (WHOLE, None, True)
    assert load_rig(path).cameras[0].calibrated_region is None
    assert kept.cameras[0].calibrated_region == Region()
    for log, cameras, said in ((before, ["K1", "K2"], []), (after, ["K2"], [f"calibration no longer fits: {unfit}"])):
        with LogReader(log) as reader:
            calibrated = [message.topic for message in reader.messages("/calibration/K1", "/calibration/K2")]
        assert calibrated == [f"/calibration/{name}" for name in cameras]
        assert [message.text for message in log_facts(log).messages if "calibration" in message.text] == said
    whole, part = _seen(before, load_rig(path)), _seen(after, kept)
    assert (whole.shape, part.shape) == ((480, 1280), (480, 960))
    crop = whole[96:336, 160:480]
    assert np.median(np.abs(part[:240, :320] - crop)) < _GREY
    assert np.median(np.abs(part[:, 320:] - whole[:, 640:])) < _GREY


def _recorded(service: Serving) -> Path:
    recording = service.post("/api/recordings", {"preroll_s": 0})["id"]
    service.await_pulses(8)
    service.post(f"/api/recordings/{recording}/stop", {"confirm": True})
    return service.data / f"{recording}.mcap"


def _seen(log: Path, rig: RigSettings) -> Floats:
    """Mean of the triplets of a log, which has one size, one pulse in each, and the regions of its cameras in it."""
    with LogReader(log) as reader:
        for _ in reader.items():
            pass
        attached = tomllib.loads(reader.attachments[RIG_ATTACHMENT].decode())
    regions = [Region(**camera.get("region", {})) for camera in attached["cameras"]]
    assert regions == [camera.region for camera in rig.cameras]
    assert max(len(pulses) for pulses in hill_pulses(log, rig).values()) == 1
    whole = [image.copy() for tag, image in triplets(log) if tag.complete]
    assert whole
    return np.asarray(np.mean(whole, axis=0), float)


def test_a_region_that_a_camera_does_not_take_is_given_back(
    tmp_path: Path, loopback: Loopback, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write_rig(tmp_path, "aravis", loopback, names=["K1", "K2"])
    rig, hub = load_rig(path), EventHub(lambda _: None)
    supervisor = Supervisor(rig, path.read_text(), hub, RecorderOptions(directory=tmp_path))
    supervisor.start()
    try:
        supervisor.ask(Arm, PATIENCE_S)
        wait_until(lambda: supervisor.status.state is State.ARMED, "the rig is armed", PATIENCE_S)
        monkeypatch.setattr(Regions, "limits", lambda *_: None)  # a camera that does not say them
        said = (
            "K1 does not read out 320 x 240 px from 328, 96: camera K1 makes its OffsetX 320 .* goes back to 640 x 480"
        )
        now = supervisor.now.in_use
        with pytest.raises(BadInputError, match=said):
            Regions(supervisor, path, 1.0).change("K1", Region(**PART | {"x": 328}), now)
        assert supervisor.status.state is State.ARMING
        assert supervisor.now.in_use == now
        wait_until(lambda: supervisor.status.state is State.ARMED, "the rig is armed as before", PATIENCE_S)
        assert [camera.state for camera in supervisor.status.cameras] == ["ready", "ready"]
    finally:
        supervisor.stop(PATIENCE_S)
    assert "event_region_refused" in [event.code for event in hub.after(0)]
