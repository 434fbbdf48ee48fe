"""Exposure and gain changed while the rig is armed: the camera takes them, logs and rig file hold them."""

import tomllib
from pathlib import Path

from recorder.reading.log_reader import LogReader
from rig.topics import RIG_ATTACHMENT, TAG
from tests.capture.rigs import write_rig
from tests.service.serving import PATIENCE_S, serving
from tests.support.loopback import Loopback
from tests.support.waiting import wait_until

K1 = "/api/cameras/K1"


def test_a_camera_takes_another_exposure_and_the_rig_file_keeps_it(tmp_path: Path, loopback: Loopback) -> None:
    path = write_rig(tmp_path, "aravis", loopback)
    path.write_text("# do not lose this line\n" + path.read_text())
    first = path.read_text()
    with serving(tmp_path, path, loopback) as service:
        service.arm()
        told = service.get(K1)
        assert (told["exposure_us"], told["gain_db"], told["saved"]) == (2000, 0, True)
        status, answer = service.call("PATCH", K1, {"exposure_us": 40_000})
        assert (status, "pulses come every 33.3 ms" in answer["detail"]) == (422, True)
        # This camera has 24 dB at most, and says so: the change has come to it.
        assert service.call("PATCH", K1, {"exposure_us": 1000, "gain_db": 30})[1]["saved"] is False
        told = "its gain is 24 dB, not 30 dB"
        wait_until(lambda: told in service.log.read_text(), "the camera says what it can", PATIENCE_S, 0.05)
        assert service.call("PATCH", K1, {"exposure_us": 1500, "gain_db": 1})[1]["exposure_us"] == 1500
        back = "K1: connected"
        wait_until(lambda: service.log.read_text().count(back) == 3, "the camera is back", PATIENCE_S, 0.05)
        assert path.read_text() == first
        recording = service.post("/api/recordings")["id"]
        status, answer = service.call("PATCH", K1, {"exposure_us": 1000})
        assert (status, "stop it, then change exposure" in answer["detail"]) == (409, True)
        service.post(f"/api/recordings/{recording}/stop")
        kept = service.call("PATCH", K1, {"save": True})[1]
        assert (kept["exposure_us"], kept["gain_db"], kept["saved"]) == (1500, 1, True)
        assert "killed" not in service.log.read_text()
        assert service.get("/api/status")["state"] == "armed"
    with LogReader(service.data / f"{recording}.mcap") as reader:
        assert any(True for _ in reader.messages(TAG.name))
        attached = tomllib.loads(reader.attachments[RIG_ATTACHMENT].decode())
    assert (attached["cameras"][0]["exposure_us"], attached["cameras"][0]["gain_db"]) == (1500, 1)
    assert path.read_text().startswith("# do not lose this line\n")
    assert tomllib.loads(path.read_text()) == attached
