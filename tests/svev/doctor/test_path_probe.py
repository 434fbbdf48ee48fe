"""How large packets come through from a camera: a simulated one, over a network that takes large ones or not."""

import json
import subprocess
import sys
from pathlib import Path
from unittest.mock import ANY

import pytest

from rig.settings.file import CONFIG
from svev.doctor.finding import Level
from svev.gige.gvcp import ask_camera
from svev.gige.path_probe import SMALL, largest_packet
from tests.simrig.gige.conftest import MakeCamera, make_camera  # noqa: F401
from tests.support.loopback import Loopback

ROOT = Path(__file__).parents[3]
#: A network of its own, whose packets have at most so many bytes; in it a camera and the doctor.
_NETWORK = """
set -e
ip link set lo mtu $1 up
exec $2 -m tests.svev.doctor.camera_and_doctor $3
"""


def test_packets_come_through_and_the_camera_is_free_again(make_camera: MakeCamera) -> None:  # noqa: F811
    camera = make_camera()
    assert [largest_packet(camera.address, size) for size in (9000, 1500, 60_000)] == [9000, 1500, 60_000]
    assert largest_packet(camera.address, 65_535) == 1500  # more than the camera makes
    assert ask_camera(camera.address, 1.0) == (ANY, False)


def test_nothing_is_known_of_a_camera_that_does_not_answer(loopback: Loopback) -> None:
    assert largest_packet(loopback.cameras(1)[0], 9000) is None


@pytest.mark.parametrize(
    ("mtu", "level", "what"),
    [
        (9000, Level.PASS, "K1: packets of 9000 bytes come through"),
        (1500, Level.FAIL, "K1: packets of 1500 bytes come through, and 9000 are asked for: no frame will arrive"),
        (1450, Level.FAIL, f"K1: packets of {SMALL} bytes come through, and 9000 are asked for: no frame will arrive"),
    ],
)
def test_a_way_that_drops_large_packets_is_named(mtu: int, level: Level, what: str) -> None:
    command = ["unshare", "--net", "sh", "-c", _NETWORK, "sh", str(mtu), sys.executable, str(CONFIG)]
    if subprocess.run([*command[:2], "true"], capture_output=True, check=False).returncode:
        pytest.skip("this machine allows no network namespaces")
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    (found,) = (each for each in json.loads(done.stdout) if each["code"].startswith("check_packets"))
    assert (found["level"], found["what"]) == (level.value, what)
    assert level is Level.PASS or "allow jumbo frames in every switch between K1" in found["remedy"]
