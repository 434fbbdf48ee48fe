"""Examines the computer: clock, processor, memory for the buffers, installed software."""

import ctypes
import importlib
import mmap
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from importlib import metadata
from pathlib import Path

from rig.host.clock_doubt import SET_THE_CLOCK, clock_doubt
from rig.host.utc_clock import utc_state
from rig.phrase import Phrase, phrase
from rig.settings.model import RigSettings
from service.processes.memory import available_bytes, memory_needed
from svev.doctor.finding import Finding, Level, Topic, failure, judged, passed, warning

_FAST = {"performance", "schedutil", "ondemand"}


def look_at_clock(files: Iterable[Path] = ()) -> Iterator[Finding]:
    """Does the clock tell the right date? It only dates recordings; pulses are paired by a clock that never jumps.

    Args:
        files: that were written before now.
    """
    if (doubt := clock_doubt(files)) is not None:
        yield judged(Level.WARN, Topic.TIME, doubt, SET_THE_CLOCK)
    elif not (clock := utc_state()).synchronized:
        yield warning(
            Topic.TIME,
            "check_clock_free",
            "the clock is not synchronized: recordings carry whatever date and time this machine believes in",
            "run: sudo apt-get install systemd-timesyncd, then wait a minute; without a network set it with `date`",
        )
    else:
        what = "the clock is synchronized, off by at most {ms:.0f} ms"
        yield passed(Topic.TIME, "check_clock", what, ms=clock.at_most_us / 1000)


def look_at_processor() -> Iterator[Finding]:
    """Are there enough cores, and do they wake up fast, which they do not in power-saving modes?"""
    policies = sorted(Path("/sys/devices/system/cpu").glob("cpu[0-9]*/cpufreq/scaling_governor"))
    governors = {policy.read_text().strip() for policy in policies}
    cores = len(os.sched_getaffinity(0))
    if slow := governors - _FAST:
        yield warning(
            Topic.PROCESSOR,
            "check_governor_slow",
            "{cores} cores, governor {governor}: frames may wait for a core to wake up",
            "run: echo performance | sudo tee /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor",
            cores=cores,
            governor=", ".join(sorted(slow)),
        )
    elif governors:
        what, told = "{cores} cores, governor: {governor}", ", ".join(sorted(governors))
        yield passed(Topic.PROCESSOR, "check_governor", what, cores=cores, governor=told)
    else:
        what = "{cores} cores, governor: none (the machine below this one decides)"
        yield passed(Topic.PROCESSOR, "check_governor_none", what, cores=cores)
    if cores < 2:
        remedy = "use a machine with at least two cores"
        yield warning(Topic.PROCESSOR, "check_one_core", "one core for all cameras", remedy)


_HUGE_PAGES = Path("/sys/kernel/mm/transparent_hugepage")
_MB = 1_000_000
_LESS_MEMORY = "end other programs, or lower recorder.ring_s, recorder.triplets_s and recorder.preroll_limit_mb"
_CAUTION = 0.5  # share of the available memory above which to warn, because other programs need memory, too


def look_at_memory(rig: RigSettings) -> Iterator[Finding]:
    """Do the rings, the triplet buffers and the pre-roll fit into the available memory?"""
    needed, free = sum(memory_needed(rig, rig.recorder.preroll_s).values()), available_bytes()
    text = "buffers need {needed:.0f} MB, {free:.0f} MB are available"
    said = phrase("check_memory", text, needed=needed / _MB, free=free / _MB)
    level = Level.FAIL if needed > free else Level.WARN if needed > _CAUTION * free else Level.PASS
    yield judged(level, Topic.MEMORY, said, _LESS_MEMORY)


def look_at_shared_memory(rig: RigSettings) -> Iterator[Finding]:
    """Can the ring of a camera be made: an anonymous file in memory (memfd), mapped and written at both ends?"""
    size = round(rig.cameras[0].frame_bytes * rig.trigger.rate_hz * rig.recorder.ring_s)
    try:
        fd = os.memfd_create("svev-doctor", os.MFD_CLOEXEC)
        try:
            os.ftruncate(fd, size)
            with mmap.mmap(fd, size) as memory:
                memory[0] = memory[-1] = 1
        finally:
            os.close(fd)
    except OSError as error:
        yield failure(
            Topic.MEMORY,
            "check_no_shared_memory",
            "no shared memory of {mb:.0f} MB for a camera's ring: {why}",
            "raise the memory limit of this login or container (ulimit -v, systemd MemoryMax)",
            mb=size / _MB,
            why=error.strerror or str(error),
        )
        return
    yield passed(Topic.MEMORY, "check_shared_memory", "shared memory for a camera's ring, {mb:.0f} MB", mb=size / _MB)


def look_at_huge_pages() -> Iterator[Finding]:
    """Are huge pages on? They save a third of the processor time from camera to disk."""
    triplets, good = phrase("user_triplets", "triplets"), {"always", "madvise"}
    yield _look_at_huge_pages(triplets, _HUGE_PAGES / "enabled", "madvise", good)
    rings, good = phrase("user_rings", "the cameras' rings"), {"always", "within_size", "advise", "force"}
    yield _look_at_huge_pages(rings, _HUGE_PAGES / "shmem_enabled", "advise", good)


def _look_at_huge_pages(user: Phrase, path: Path, advised: str, good: set[str]) -> Finding:
    # The kernel lists all choices, with the one in force in brackets.
    chosen = re.search(r"\[(\w+)\]", path.read_text()) if path.exists() else None
    if chosen is None:
        what, remedy = "this kernel has no huge pages for {user}", "use a kernel with transparent huge pages"
        return warning(Topic.MEMORY, "check_no_huge_pages", what, remedy, user=user)
    what, remedy = "huge pages for {user}: {chosen}", "run: echo {advised} | sudo tee {path}"
    if chosen[1] in good:
        return passed(Topic.MEMORY, "check_huge_pages", what, user=user, chosen=chosen[1])
    return warning(
        Topic.MEMORY, "check_huge_pages_off", what, remedy, user=user, chosen=chosen[1], advised=advised, path=str(path)
    )


#: A module of each Python package.
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
    """Is this the Python of the distribution? Any other one does not find Aravis."""
    version = ".".join(map(str, sys.version_info[:3]))
    if sys.base_prefix == _DISTRIBUTION_PREFIX:
        yield passed(Topic.SOFTWARE, "check_python", "Python {version} of the distribution", version=version)
    else:
        yield failure(
            Topic.SOFTWARE,
            "check_other_python",
            "Python {version} in {prefix} is not the distribution's, so it does not find Aravis",
            "make the environment with: /usr/bin/python3 -m venv --system-site-packages .venv",
            version=version,
            prefix=sys.base_prefix,
        )


def look_at_packages() -> Iterator[Finding]:
    """Can every Python package that Svev needs be loaded?"""
    found = []
    for package, module in _PACKAGES.items():
        try:
            importlib.import_module(module)
            found.append(f"{package} {metadata.version(package)}")
        except ImportError as error:
            yield failure(
                Topic.SOFTWARE,
                "check_package_missing",
                "{package} cannot be loaded: {why}",
                "run `make setup`, or install svev's wheel again",
                package=package,
                why=str(error),
            )
    yield passed(Topic.SOFTWARE, "check_packages", "{packages}", packages=", ".join(found))


def look_at_camera_libraries(rig: RigSettings) -> Iterator[Finding]:
    """Can Aravis (GigE Vision) and libdc1394 (FireWire) be loaded? One that the rig does not use may be missing."""
    backends = {camera.backend for camera in rig.cameras}
    yield _look_at_library("Aravis", "gir1.2-aravis-0.8", _load_aravis, needed="aravis" in backends)
    yield _look_at_library("libdc1394", "libdc1394-25", _load_libdc1394, needed="iidc" in backends)


def _look_at_library(name: str, package: str, load: Callable[[], None], *, needed: bool) -> Finding:
    try:
        load()
    except (ImportError, ValueError, OSError) as error:
        what, why = "{library} cannot be loaded: {why}", str(error)
        said = phrase("check_library_missing", what, library=name, why=why, package=package)
        level = Level.FAIL if needed else Level.WARN
        return judged(level, Topic.SOFTWARE, said, f"run: sudo apt-get install {package} python3-gi")
    what, version = "{library} {version}", _debian_version(package)
    return passed(Topic.SOFTWARE, "check_library", what, library=name, version=version)


def _load_aravis() -> None:
    import gi  # noqa: PLC0415 - this probe finds out whether it can be imported

    gi.require_version("Aravis", "0.8")
    from gi.repository import Aravis  # noqa: PLC0415, F401


def _load_libdc1394() -> None:
    ctypes.CDLL(_LIBDC1394)


def _debian_version(package: str) -> str:
    """Version of a Debian package; the libraries themselves do not tell theirs."""
    dpkg = shutil.which("dpkg-query")
    if dpkg is None:
        return "(not from a Debian package)"
    command = [dpkg, "--show", "--showformat=${Version}", package]
    done = subprocess.run(command, capture_output=True, text=True, timeout=_DPKG_S, check=False)
    return done.stdout or "(not from a Debian package)"
