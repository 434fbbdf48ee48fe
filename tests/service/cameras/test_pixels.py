"""Rigs of cameras that differ in size and send 10 or 12 bits, or colours: recorded, published, read, exported."""

import json
from collections.abc import Sequence
from pathlib import Path

import av
import cv2
import httpx
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

from analysis.film.export import export
from analysis.worker.stream import Source, connected
from recorder.checking.verify import verify
from recorder.reading.triplets import triplets
from recorder.recovering.recover import recover
from rig.api.export import ExportOrder, Kind
from rig.images.pixels import FORMATS
from rig.settings.file import load_rig
from simrig.images import stamp
from tests.capture.rigs import write_rig
from tests.service.serving import serving
from tests.support.commands import Command, start_svev
from tests.support.loopback import Loopback

SIZES = [(320, 240), (200, 160), (48, 300)]


def _rig(folder: Path, backend: str, loopback: Loopback, formats: Sequence[str], rate_hz: float = 30.0) -> Path:
    path = write_rig(folder, backend, loopback, rate_hz=rate_hz)
    text = path.read_text()
    for place, ((width, height), name) in enumerate(zip(SIZES, formats, strict=True), 1):
        line = f'name = "K{place}"\n'
        own = f'pixel_format = "{name}"\nregion = {{ width = {width}, height = {height} }}\n'
        text = text.replace(line, line + own)
    path.write_text(text)
    return path


def _start(rig: Path, out: Path, seconds: int) -> Command:
    return start_svev("record", "--rig", str(rig), "--seconds", str(seconds), "--out", str(out), "--json")


def _log(process: Command) -> Path:
    out, err = process.communicate(timeout=60)
    assert process.returncode == 0, err
    result = json.loads(out)
    assert result["pulses"] == result["complete"] >= 29, err
    return Path(result["log"])


@pytest.mark.parametrize(
    ("backend", "formats", "seconds"),
    [
        ("aravis", ("Mono12Packed", "Mono12p", "Mono12"), 1),
        # One process is all of its cameras: at half the rate.
        pytest.param("iidc", ("Mono10",) * 3, 2, marks=pytest.mark.long),
        pytest.param("sim", ("BayerRG8",) * 3, 1, marks=pytest.mark.long),
    ],
    ids=["mono16", "firewire", "bayer"],
)
def test_a_recording(tmp_path: Path, loopback: Loopback, backend: str, formats: Sequence[str], seconds: int) -> None:
    rig = _rig(tmp_path, backend, loopback, formats, rate_hz=30 / seconds)
    held = FORMATS[formats[0]].pixels
    published = {}
    process = _start(rig, tmp_path / "logs", seconds)
    with connected(Source(load_rig(rig).network.publish)) as stream:
        while process.poll() is None:
            if (received := stream.next(0.05)) is not None and received.image is not None:
                published[received.tag.pulse] = received.image
    log = _log(process)
    assert verify(log).verdict == "clean"
    compared = 0
    for tag, image in triplets(log):
        assert (tag.shape, tag.pixels, image.dtype) == ((300, 568), held, held.dtype)
        stamps = [stamp.read(image[camera.part]) for camera in tag.cameras]
        assert [found.camera for found in stamps if found] == [0, 1, 2]
        assert len({found.pulse for found in stamps if found}) == 1
        assert not image[240:, :320].any()
        assert not image[160:, 320:520].any()
        if tag.pulse in published:
            compared += 1
            assert np.array_equal(published[tag.pulse], image)
    assert compared > 10
    with log.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        message = next(iter(reader.iter_decoded_messages(topics=["/triplet"]))).decoded_message
    assert (message.encoding, message.step, len(message.data)) == (
        held.encoding,
        568 * held.size,
        300 * 568 * held.size,
    )
    recovered = tmp_path / "recovered.mcap"
    recover(log, recovered)
    assert [(t, i.tobytes()) for t, i in triplets(recovered)] == [(t, i.tobytes()) for t, i in triplets(log)]
    _exported(log, tmp_path)


def test_the_panel_shows_colours(tmp_path: Path, loopback: Loopback) -> None:
    with serving(tmp_path, _rig(tmp_path, "sim", loopback, ("BayerGB8",) * 3), loopback) as service:
        service.arm()
        recording = service.post("/api/recordings", {"preroll_s": 0})["id"]
        service.await_pulses(5)
        service.post(f"/api/recordings/{recording}/stop")
        path = f"{service.url}/api/recordings/{recording}/pulses/2"
        pictures = [
            httpx.get(address, timeout=60, trust_env=False).raise_for_status().content
            for address in (f"{service.url}/api/preview.jpg", f"{path}.jpg", f"{path}.png")
        ]
        aids = service.get("/api/cameras/K3/aids")
        close_up = httpx.get(f"{service.url}/api/cameras/K3/picture.jpg?peaking=true", timeout=60, trust_env=False)
    assert (aids["status"], sum(aids["histogram"]), aids["focus"] > 0) == ("ok", 48 * 300, True)
    picture = cv2.imdecode(np.frombuffer(close_up.content, np.uint8), cv2.IMREAD_UNCHANGED)
    assert picture is not None
    assert picture.shape == (300, 48, 3)
    for data in pictures:
        picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
        assert picture is not None
        assert picture.shape == (300, 568, 3)
        assert 40 < picture[:160].mean() < 200


def _exported(log: Path, folder: Path) -> None:
    """Pictures lose nothing, a video has as many pictures as pulses, and the sheet shows something."""
    tag, image = next(iter(triplets(log)))
    export(log, ExportOrder(kind=Kind.PNG, first=1, last=2), folder / "pictures")
    own = cv2.imread(str(folder / "pictures" / "K2" / "K2_000001.png"), cv2.IMREAD_UNCHANGED)
    assert own is not None
    if tag.pixels.bits > 8:
        assert np.array_equal(own, image[tag.cameras[1].part] << 16 - tag.pixels.bits)
    else:
        assert own.shape == (160, 200, 3)
        assert own[5:-5, 5:-5, 0].mean() > 1.05 * own[5:-5, 5:-5, 2].mean()  # the filters take most of the red
    for kind, ending in ((Kind.FFV1, "mkv"), (Kind.H264, "mp4")):
        video = folder / f"video.{ending}"
        export(log, ExportOrder(kind=kind, last=5, burn_in=True), video)
        with av.open(str(video)) as opened:
            frames = [frame.to_ndarray(format="gray") for frame in opened.decode(video=0)]
        assert len(frames) == 5
        assert 40 < frames[0][:160].mean() < 200
    export(log, ExportOrder(kind=Kind.CONTACT_SHEET), folder / "sheet.png")
    sheet = cv2.imread(str(folder / "sheet.png"))
    assert sheet is not None
    assert sheet[150:400, 100:600].mean() > 60
