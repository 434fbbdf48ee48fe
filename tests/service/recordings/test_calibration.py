"""The calibration that a rig file names: in every log of `svev record` and `svev serve`, kept by `svev recover`."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from photogrammetry.network.file_writer import write_network
from svev.cli import main
from tests.capture.rigs import write_rig
from tests.photogrammetry.synthetic import lab_frame
from tests.service.serving import PATIENCE_S, serving
from tests.support.commands import run_svev
from tests.support.loopback import Loopback

CAMERA: dict[str, Any] = dict.fromkeys(
    ("x0", "y0", "a1", "a2", "a3", "b1", "b2", "c1", "c2", "r0"), 0.0
) | {"c": 1419.7, "distortion": "projected"}  # fmt: skip
GOOD = {"format": "svev-adjustment/1", "converged": True, "cameras": dict.fromkeys(("K1", "K2", "K3"), CAMERA)}


def _calibrated_rig(folder: Path, loopback: Loopback) -> Path:
    """A rig file of the simulated hill that names poses.json beside it."""
    path = write_rig(folder, "sim", loopback)
    path.write_text('calibration = "poses.json"\n' + path.read_text())
    return path


def _svev(*arguments: str) -> "subprocess.CompletedProcess[str]":
    return run_svev(*arguments, timeout_s=PATIENCE_S)


def _calibration(log: Path) -> tuple[bytes, dict[str, CameraCalibration]]:
    """Attachment and channels, as any reader of MCAP finds them."""
    with log.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        attached = {attachment.name: attachment.data for attachment in reader.iter_attachments()}
        topics = [f"/calibration/K{number}" for number in (1, 2, 3)]
        found = {}
        for schema, channel, message, decoded in reader.iter_decoded_messages(topics=topics):
            assert schema is not None
            assert (schema.name, schema.encoding, channel.message_encoding) == (
                "foxglove.CameraCalibration", "protobuf", "protobuf",
            )  # fmt: skip
            assert channel.topic not in found, "once in each log"
            found[channel.topic] = CameraCalibration.FromString(message.data)
            assert list(decoded.K) == list(found[channel.topic].K)
    assert list(found) == topics
    return attached["calibration.json"], found


def test_a_recording_holds_the_calibration_and_recovery_keeps_it(tmp_path: Path, loopback: Loopback) -> None:
    """What `svev calibrate` made of images of a frame, through rig file, service and recorder into the log."""
    write_network(lab_frame(2, points=30).network, tmp_path / "frame.json")
    assert main(["calibrate", str(tmp_path / "frame.json"), "-o", str(tmp_path / "poses.json")]) == 0
    rig = _calibrated_rig(tmp_path, loopback)
    done = _svev("record", "--rig", str(rig), "--seconds", "1", "--out", str(tmp_path / "logs"), "--json")
    assert done.returncode == 0, done.stderr
    log = Path(json.loads(done.stdout)["log"])
    attached, cameras = _calibration(log)
    assert attached == (tmp_path / "poses.json").read_bytes()
    adjusted = json.loads(attached)["cameras"]
    for name in ("K1", "K2", "K3"):
        camera = cameras[f"/calibration/{name}"]
        c, y0 = adjusted[name]["c"], adjusted[name]["y0"]
        assert (camera.width, camera.height, camera.frame_id) == (640, 480, name)
        assert camera.K[4] == pytest.approx(c, rel=0.01)
        assert camera.K[5] == pytest.approx(239.5 - y0, abs=0.01)
    assert main(["verify", str(log)]) == 0
    info = json.loads(_svev("info", str(log), "--json").stdout)
    assert [info["messages"][f"/calibration/K{number}"] for number in (1, 2, 3)] == [1, 1, 1]

    torn = tmp_path / "torn.mcap"
    torn.write_bytes(log.read_bytes()[: log.stat().st_size // 2])
    for damaged, whole, code in ((log, tmp_path / "copy.mcap", 0), (torn, tmp_path / "whole.mcap", 3)):
        _svev("recover", str(damaged), "-o", str(whole))
        assert main(["verify", str(whole)]) == code  # nobody knows what came after the torn end
        assert _calibration(whole) == (attached, cameras)


def test_every_recording_of_the_service_holds_it(tmp_path: Path, loopback: Loopback) -> None:
    rig = _calibrated_rig(tmp_path, loopback)
    (tmp_path / "poses.json").write_text(json.dumps(GOOD))
    with serving(tmp_path, rig, loopback) as service:
        service.arm()
        logs = []
        for _ in range(2):
            recording = service.post("/api/recordings", {"preroll_s": 0.5})["id"]
            service.await_pulses(5)
            service.post(f"/api/recordings/{recording}/stop")
            service.await_state("armed")
            logs.append(service.data / f"{recording}.mcap")
        assert service.get("/api/rig")["settings"]["calibration"] == str(tmp_path / "poses.json")
    for log in logs:
        attached, cameras = _calibration(log)
        assert json.loads(attached) == GOOD
        assert list(cameras["/calibration/K3"].K) == [1419.7, 0.0, 319.5, 0.0, 1419.7, 239.5, 0.0, 0.0, 1.0]


def test_a_large_calibration_fits_through(tmp_path: Path, loopback: Loopback) -> None:
    """Larger than the buffers of the channel to the recorder, as the result of a large network is."""
    rig = _calibrated_rig(tmp_path, loopback)
    large = GOOD | {"points": {f"F{number}": {"X": [0.1, 0.2, 0.3], "rays": 5} for number in range(25_000)}}
    (tmp_path / "poses.json").write_text(json.dumps(large))
    assert (tmp_path / "poses.json").stat().st_size > 1_000_000
    done = _svev("record", "--rig", str(rig), "--seconds", "1", "--out", str(tmp_path / "logs"), "--json")
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert (result["pulses"], result["complete"]) == (30, 30)
    assert _calibration(Path(result["log"]))[0] == (tmp_path / "poses.json").read_bytes()


@pytest.mark.parametrize(
    ("result", "words"),
    [
        pytest.param(None, 'poses.json: no such file; correct "calibration" in the rig file', id="missing"),
        pytest.param(
            GOOD | {"cameras": {"K1": CAMERA, "K2": CAMERA}}, "poses.json: lacks camera K3 of the rig", id="camera"
        ),
        pytest.param(GOOD | {"converged": False}, "poses.json: this calibration has no result", id="not converged"),
        pytest.param(
            GOOD | {"cameras": dict.fromkeys(("K1", "K2", "K3"), CAMERA | {"c": 8.0})},
            "poses.json: cameras.K1: c = 8 cannot be in pixels where images are 640 px wide",
            id="millimetres",
        ),
    ],
)
def test_a_calibration_that_is_no_good_is_refused_at_the_start(
    tmp_path: Path, loopback: Loopback, result: dict[str, Any] | None, words: str
) -> None:
    rig = _calibrated_rig(tmp_path, loopback)
    if result is not None:
        (tmp_path / "poses.json").write_text(json.dumps(result))
    for command in (
        ("record", "--seconds", "1", "--out", str(tmp_path / "logs")),
        ("serve", "--host", loopback.host, "--port", "0", "--data", str(tmp_path / "data")),
    ):
        done = _svev(*command, "--rig", str(rig))
        assert done.returncode == 2, done.stderr
        assert words in done.stderr
        assert len(done.stderr.strip().splitlines()) == 1
    assert not list(tmp_path.glob("*/*.mcap"))


def test_a_rig_without_calibration_loads_no_photogrammetry(tmp_path: Path, loopback: Loopback) -> None:
    program = (
        "import sys\n"
        "from pathlib import Path\n"
        "import svev.serving.composition\n"
        "from rig.settings.file import load_rig\n"
        "from service.headless import HeadlessRig\n"
        "HeadlessRig(load_rig(Path(sys.argv[1])), '', print)\n"
        "print(sorted({name.split('.')[0] for name in sys.modules} & {'photogrammetry', 'scipy'}))\n"
    )

    def loaded(rig: Path) -> str:
        command = [sys.executable, "-c", program, str(rig)]
        return subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, check=True).stdout.strip()

    assert loaded(write_rig(tmp_path, "sim", loopback)) == "[]"
    (tmp_path / "poses.json").write_text(json.dumps(GOOD))
    assert loaded(_calibrated_rig(tmp_path, loopback)) == "['photogrammetry', 'scipy']"
