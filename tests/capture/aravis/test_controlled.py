"""A camera that another program controls."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from rig.errors import CameraError
from tests.capture.aravis.camera import one_camera
from tests.support.loopback import Loopback
from tests.support.reliability import FaultTable

#: Another program: a viewer with the camera open.
_VIEWER = """
import sys, gi
gi.require_version("Aravis", "0.8")
from gi.repository import Aravis
for interface in ("USB3Vision", "Fake"):
    Aravis.disable_interface(interface)
camera = Aravis.Camera.new(sys.argv[1])
print(camera.get_device().is_controller(), flush=True)
sys.stdin.read()
"""


@contextmanager
def _viewed(address: str) -> Iterator[None]:
    """Within, another program controls the camera."""
    command = [sys.executable, "-c", _VIEWER, address]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as viewer:
        assert viewer.stdout is not None
        assert viewer.stdout.readline() == "True\n"
        yield


def test_a_camera_that_another_program_holds_is_called_so(
    tmp_path: Path, loopback: Loopback, fault_table: FaultTable
) -> None:
    with one_camera(tmp_path, loopback) as one:
        with _viewed(one.address):
            for _ in range(2):
                with pytest.raises(
                    CameraError, match=r"K2 at .* is controlled by another program: close that program"
                ) as held:
                    one.open()
        with one.opened() as camera:
            one.frames(camera, 3)
    said = str(held.value).replace(one.address, "ADDRESS")
    what = "another program controls a camera"
    fault_table.tell("Network and other programs", what, lost="none: its frames, absent", said=said)
