"""Logs with a topic for each camera, from real processes to everybody who uses triplets."""

import json
import threading
from pathlib import Path

import cv2
import httpx
import numpy as np
import pytest
import zmq
from mcap.reader import make_reader
from numpy.typing import NDArray

from recorder.checking.verify import verify
from recorder.reading.triplets import triplets
from rig.frame import FrameStatus
from rig.settings.file import load_rig
from rig.tag import TripletTag
from tests.capture.rigs import write_rig
from tests.service.serving import serving
from tests.support.commands import run_svev
from tests.support.loopback import Loopback

pytestmark = pytest.mark.long

_TOPICS = {f"/camera/K{number}" for number in (1, 2, 3)}


def _rig(folder: Path, backend: str, loopback: Loopback, log: Path | None = None) -> Path:
    folder.mkdir(exist_ok=True)
    path = write_rig(folder, backend, loopback, log=log)
    path.write_text(path.read_text() + "[recorder]\nper_camera_topics = true\n")
    return path


def _record(rig: Path, out: Path) -> Path:
    done = run_svev("record", "--rig", str(rig), "--seconds", "2", "--out", str(out), "--json", timeout_s=120)
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    assert result["pulses"] >= 59, done.stderr
    assert result["complete"] > 30, done.stderr  # a busy machine loses frames; which ones, the log says
    return Path(result["log"])


def _topics_of(log: Path) -> set[str]:
    with log.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    return {channel.topic for channel in summary.channels.values()}


class _Subscriber(threading.Thread):
    """Collects the triplets that are published until it is ended."""

    def __init__(self, context: "zmq.Context[zmq.Socket[bytes]]", endpoint: str) -> None:
        super().__init__(name="subscriber")
        self._socket = context.socket(zmq.SUB)
        self._socket.setsockopt(zmq.SUBSCRIBE, b"triplet")
        self._socket.connect(endpoint)
        self.images: dict[int, bytes] = {}  # by time of the pulse
        self._ended = threading.Event()

    def run(self) -> None:
        while not self._ended.is_set():
            if self._socket.poll(50):
                _, tag, image = self._socket.recv_multipart()
                self.images[TripletTag.decode(tag).time] = image
        self._socket.close(linger=0)

    def end(self) -> None:
        self._ended.set()
        self.join()


def test_subscribers_get_the_triplets_of_the_log_and_it_can_be_replayed(tmp_path: Path, loopback: Loopback) -> None:
    rig = _rig(tmp_path / "live", "aravis", loopback)
    with zmq.Context() as context:
        subscriber = _Subscriber(context, load_rig(rig).network.publish)
        subscriber.start()
        try:
            log = _record(rig, tmp_path / "logs")
        finally:
            subscriber.end()
    assert _topics_of(log) >= _TOPICS
    assert "/triplet" not in _topics_of(log)
    assert verify(log).verdict in {"clean", "partial"}
    compared = 0
    for tag, image in triplets(log):
        assert image.any() == any(camera.status is FrameStatus.OK for camera in tag.cameras)
        if (published := subscriber.images.get(tag.time)) is not None:
            assert published == image.tobytes()
            compared += 1
    assert compared > 30
    again = _record(_rig(tmp_path / "replay", "replay", loopback, log), tmp_path / "again")
    pictures = {image.tobytes() for _, image in triplets(log)}
    assert all(image.tobytes() in pictures for _, image in triplets(again))


@pytest.mark.parametrize("preroll_s", [0.0, 2.0])
def test_the_panel_shows_them(tmp_path: Path, loopback: Loopback, preroll_s: float) -> None:
    with serving(tmp_path, _rig(tmp_path, "sim", loopback), loopback) as service:
        service.arm()
        preview = httpx.get(f"{service.url}/api/preview.jpg", timeout=60, trust_env=False)
        recording = service.post("/api/recordings", {"preroll_s": preroll_s})["id"]
        service.await_pulses(30)
        service.post(f"/api/recordings/{recording}/stop")
        assert service.get(f"/api/recordings/{recording}")["verdict"]["code"] == "verdict_complete"
        path = f"{service.url}/api/recordings/{recording}"
        jpeg = httpx.get(f"{path}/pulses/7.jpg", timeout=60, trust_env=False)
        small = httpx.get(f"{path}/thumbnail.jpg", timeout=60, trust_env=False)
        log = service.data / f"{recording}.mcap"
    assert _topics_of(log) >= _TOPICS
    (image,) = (image.copy() for tag, image in triplets(log) if tag.pulse == 7)
    assert np.abs(_decoded(jpeg) - image).mean() < 5
    live = _decoded(preview)
    assert live.shape[0] * 4 == live.shape[1]  # made smaller, side by side
    assert live.std() > 5
    assert small.status_code == 200


def _decoded(jpeg: httpx.Response) -> NDArray[np.float64]:
    image = cv2.imdecode(np.frombuffer(jpeg.raise_for_status().content, np.uint8), cv2.IMREAD_GRAYSCALE)
    assert image is not None
    return image.astype(np.float64)
