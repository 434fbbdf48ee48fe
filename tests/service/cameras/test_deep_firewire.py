"""FireWire cameras of 16 bits: a real service and the real libdc1394, from the picture on the page to the balls.

The cameras are on an emulated bus that the rig file knows nothing of, as it knows nothing of a real one.
"""

import subprocess
import sys
from pathlib import Path

import cv2
import httpx
import numpy as np
import pytest

from analysis.scene.detection import detect_balls
from analysis.scene.orientation import orient_images
from analysis.scene.static_image import StaticImage, static_image
from analysis.worker.stream import Received, Source, connected
from recorder.checking.verify import verify
from rig.images.picture import Grey, measurable
from simrig.firewire.camera.geometry import Deep
from simrig.programs.simulated_hill import SimulatedHill
from simrig.world.scenario import Scenario, load_scenario
from tests.analysis.scene.hill import balls_in, normalized_error, survey_json, survey_of
from tests.capture.rigs import guids, write_rig
from tests.service.serving import serving
from tests.support.loopback import Loopback

pytestmark = pytest.mark.long

NAMES = ("K1", "K2", "K3")
RATE_HZ = 4.0
PULSES = 8


def test_the_picture_is_neither_black_nor_clipped_and_the_balls_are_found(tmp_path: Path, loopback: Loopback) -> None:
    path = write_rig(tmp_path, "iidc", loopback, rate_hz=RATE_HZ)
    text = path.read_text().replace('[simulation]\nscenario = "scenario.toml"\n', "")
    path.write_text(text.replace('backend = "iidc"', 'backend = "iidc"\npixel_format = "Mono16"'))
    scenario = tmp_path / "scenario.toml"
    cameras = dict(zip(NAMES, guids(len(NAMES)), strict=True))
    with (
        SimulatedHill(
            scenario, {}, RATE_HZ, firewire=cameras, deep=Deep(16, at_top=False, signed_bytes="high")
        ) as hill,
        serving(tmp_path, path, loopback, environment=hill.environment) as service,
    ):
        service.arm()
        recording = service.post("/api/recordings", {"preroll_s": 0})["id"]
        service.await_pulses(PULSES)
        service.post(f"/api/recordings/{recording}/stop")
        answer = httpx.get(f"{service.url}/api/preview.jpg", timeout=60, trust_env=False).raise_for_status()
        log = service.data / f"{recording}.mcap"
    assert verify(log).verdict == "clean"
    triplets = _replayed(log, loopback)
    assert len(triplets) >= PULSES
    assert {(each.tag.pixels.bits, each.tag.complete) for each in triplets} == {(16, True)}
    grey = [_grey(each) for each in triplets]
    _is_a_picture(answer.content, grey[-1])
    _has_the_balls(
        {
            camera.name: static_image(camera.name, [image[camera.part] for image in grey])
            for camera in triplets[0].tag.cameras
        },
        load_scenario(scenario),
    )


def _replayed(log: Path, loopback: Loopback) -> list[Received]:
    """The triplets, as the worker of the analysis gets them."""
    address = loopback.endpoint()
    command = [sys.executable, "-m", "svev", "replay", str(log), "--reliable", "--speed", "max", "--bind", address]
    found = []
    with (
        subprocess.Popen([*command, "--wait", "60"], stdout=subprocess.DEVNULL) as replay,
        connected(Source(address, reliable=True)) as stream,
    ):
        while (received := stream.next(0.2)) is not None or replay.poll() is None:
            if received is not None:
                found.append(received)
        assert (replay.wait(60), stream.refused) == (0, 0)
    return found


def _grey(received: Received) -> Grey:
    assert received.image is not None
    return measurable(received.image, received.tag.pixels)


def _is_a_picture(jpeg: bytes, grey: Grey) -> None:
    """It looks as what is measured in, which another pulse of the same hill shows."""
    picture = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_GRAYSCALE)
    assert picture is not None
    assert grey.shape == (480, 1920)
    small = np.asarray(cv2.resize(grey, picture.shape[::-1], interpolation=cv2.INTER_AREA))
    assert 40 < picture.mean() < 200
    assert max(np.mean(picture < 4), np.mean(picture > 251)) < 0.02
    assert np.corrcoef(picture.ravel(), small.ravel())[0, 1] > 0.95
    assert abs(picture.mean() - small.mean()) < 2


def _has_the_balls(static: dict[str, StaticImage], scenario: Scenario) -> None:
    found = {name: detect_balls(image) for name, image in static.items()}
    for name in NAMES:
        off = [np.linalg.norm(found[name].xy - xy, axis=1).min() for xy in balls_in(scenario, name).values()]
        assert len(off) > 15
        assert max(off) < 0.1
    scene = orient_images(static, survey_of(survey_json(scenario, 1)), found)
    assert list(scene.cameras) == list(NAMES)
    assert np.abs(normalized_error(scene, scenario)).max() < 5
