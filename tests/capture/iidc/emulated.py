"""The unmodified libdc1394 inside the test's own process, on an emulated FireWire bus.

A process of its own gets the shim by LD_PRELOAD. A test process is running already, so an empty library that needs the
shim and then libdc1394 is loaded with RTLD_DEEPBIND: libdc1394 then looks for `open`, `ioctl` and so on in the shim
before the C library. Without SVEV_FIREWIRE_BUS in the environment the shim does nothing.
"""

import ctypes
import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from capture.iidc import dma
from capture.iidc.library import SONAME
from rig.settings.camera import CameraSettings
from rig.transport.ring import CameraRing
from simrig.firewire.host.build import shim
from simrig.programs.simulated_hill import SimulatedHill
from tests.capture.rigs import SCENARIO

GUIDS = {f"K{number}": f"000a4701011b000{number}" for number in (1, 2, 3)}
GCC = shutil.which("gcc") or "gcc"
_VARIABLE = "SVEV_FIREWIRE_BUS"


def interpose() -> None:
    """Put the shim under libdc1394. Called when test modules are imported, before any test can load libdc1394."""
    with tempfile.TemporaryDirectory() as directory:
        front = Path(directory) / "front.so"
        found = ["-Wl,--no-as-needed", str(shim()), f"-l:{SONAME}"]
        subprocess.run([GCC, "-shared", "-o", str(front), *found], check=True, timeout=60)
        if SONAME in Path("/proc/self/maps").read_text():
            raise RuntimeError(f"{SONAME} is loaded already: load the shim first")
        ctypes.CDLL(str(front), mode=os.RTLD_DEEPBIND | os.RTLD_NOW)
    # Under LD_PRELOAD the program's own `close` is the shim's as well.
    vars(dma)["close"] = ctypes.CDLL(str(shim()))["close"]


@contextmanager
def visible(hill: SimulatedHill) -> Iterator[SimulatedHill]:
    """Within the context, this process sees the hill's FireWire bus."""
    os.environ[_VARIABLE] = hill.environment[_VARIABLE]
    try:
        yield hill
    finally:
        del os.environ[_VARIABLE]


@contextmanager
def emulated_bus(
    *names: str, rate_hz: float = 30.0, scenario: Path = SCENARIO, **options: Any
) -> Iterator[SimulatedHill]:
    """A bus with cameras of the training scenario, or of one made from it, seen by this process."""
    cameras = {name: GUIDS[name] for name in names or ("K1",)}
    with SimulatedHill(scenario, {}, rate_hz, firewire=cameras, **options) as hill, visible(hill):
        yield hill


@contextmanager
def camera_ring(settings: CameraSettings, slots: int = 16) -> Iterator[CameraRing]:
    """A ring for the frames of one camera."""
    ring = CameraRing.create(settings.name, settings.frame_bytes, slots)
    try:
        yield ring
    finally:
        ring.close()


def settings(name: str = "K1", **changes: Any) -> CameraSettings:
    """One camera of a rig file."""
    return CameraSettings.model_validate({"name": name, "backend": "iidc", "address": GUIDS[name], **changes})


if _VARIABLE not in os.environ:
    interpose()
