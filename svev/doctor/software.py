"""Is the software there, and from where it must come?"""

import ctypes
import importlib
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from importlib import metadata

from rig.settings import RigSettings
from svev.doctor.finding import Finding, Topic, failure, passed, warning

#: Distribution -> module that it brings.
_PACKAGES = {
    "numpy": "numpy",
    "opencv-python-headless": "cv2",
    "pyzmq": "zmq",
    "mcap": "mcap.reader",
    "mcap-protobuf-support": "mcap_protobuf.decoder",
    "foxglove-schemas-protobuf": "foxglove_schemas_protobuf.RawImage_pb2",
    "isal": "isal.isal_zlib",
    "pydantic": "pydantic",
}
_DISTRIBUTION_PREFIX = "/usr"
_LIBDC1394 = "libdc1394.so.25"
_DPKG_S = 5.0


def look_at_python() -> Iterator[Finding]:
    """Aravis is bound to the distribution's Python: any other one does not find it."""
    version = ".".join(map(str, sys.version_info[:3]))
    if sys.base_prefix == _DISTRIBUTION_PREFIX:
        yield passed(Topic.SOFTWARE, f"Python {version} of the distribution")
    else:
        yield failure(
            Topic.SOFTWARE,
            f"Python {version} in {sys.base_prefix} is not the distribution's, so it does not find Aravis",
            "make the environment with: /usr/bin/python3 -m venv --system-site-packages .venv",
        )


def look_at_packages() -> Iterator[Finding]:
    """Every Python package that Svev needs can be loaded."""
    found = []
    for package, module in _PACKAGES.items():
        try:
            importlib.import_module(module)
            found.append(f"{package} {metadata.version(package)}")
        except ImportError as error:
            yield failure(
                Topic.SOFTWARE,
                f"{package} cannot be loaded: {error}",
                "run `make setup`, or install svev's wheel again",
            )
    yield passed(Topic.SOFTWARE, ", ".join(found))


def look_at_camera_libraries(rig: RigSettings) -> Iterator[Finding]:
    """Aravis for GigE Vision and libdc1394 for FireWire; what the rig does not use may be missing."""
    backends = {camera.backend for camera in rig.cameras}
    yield _look_at_library("Aravis", "gir1.2-aravis-0.8", _load_aravis, needed="aravis" in backends)
    yield _look_at_library("libdc1394", "libdc1394-25", _load_libdc1394, needed="iidc" in backends)


def _look_at_library(name: str, package: str, load: Callable[[], None], *, needed: bool) -> Finding:
    try:
        load()
    except (ImportError, ValueError, OSError) as error:
        judge = failure if needed else warning
        return judge(
            Topic.SOFTWARE, f"{name} cannot be loaded: {error}", f"run: sudo apt-get install {package} python3-gi"
        )
    return passed(Topic.SOFTWARE, f"{name} {_debian_version(package)}")


def _load_aravis() -> None:
    import gi  # noqa: PLC0415 - may be missing: that is what is looked for

    gi.require_version("Aravis", "0.8")
    from gi.repository import Aravis  # noqa: PLC0415, F401


def _load_libdc1394() -> None:
    ctypes.CDLL(_LIBDC1394)


def _debian_version(package: str) -> str:
    """Neither library tells its version by itself; the package manager does."""
    dpkg = shutil.which("dpkg-query")
    if dpkg is None:
        return "(not from a Debian package)"
    command = [dpkg, "--show", "--showformat=${Version}", package]
    done = subprocess.run(command, capture_output=True, text=True, timeout=_DPKG_S, check=False)
    return done.stdout or "(not from a Debian package)"
