"""Is there memory for the rings, and is it of the cheap kind?"""

import mmap
import os
import re
from collections.abc import Iterator
from pathlib import Path

from rig.settings import RigSettings
from svev.doctor.finding import Finding, Topic, failure, passed, warning

_HUGE_PAGES = Path("/sys/kernel/mm/transparent_hugepage")
_MB = 1_000_000
_CAUTION = 0.5  # more of the free memory than this is worth a warning: other programs want some, too


def memory_needed(rig: RigSettings) -> int:
    """Bytes of the cameras' rings and of the triplets that wait for the disk."""
    per_pulse = sum(camera.frame_bytes for camera in rig.cameras)
    return round(per_pulse * rig.trigger.rate_hz * (rig.recorder.ring_s + rig.recorder.triplets_s))


def look_at_memory(rig: RigSettings) -> Iterator[Finding]:
    """The rings and the triplets fit into what is free."""
    needed, free = memory_needed(rig), _available()
    what = f"buffers need {needed / _MB:.0f} MB, {free / _MB:.0f} MB are available"
    if needed > free:
        yield failure(Topic.MEMORY, what, "end other programs, or lower recorder.ring_s and recorder.triplets_s")
    elif needed > _CAUTION * free:
        yield warning(Topic.MEMORY, what, "end other programs, or lower recorder.ring_s and recorder.triplets_s")
    else:
        yield passed(Topic.MEMORY, what)


def look_at_shared_memory(rig: RigSettings) -> Iterator[Finding]:
    """One camera's ring can really be made: an anonymous file in memory (memfd), mapped and touched at its ends."""
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
            f"no shared memory of {size / _MB:.0f} MB for a camera's ring: {error.strerror}",
            "raise the memory limit of this login or container (ulimit -v, systemd MemoryMax)",
        )
        return
    yield passed(Topic.MEMORY, f"shared memory for a camera's ring, {size / _MB:.0f} MB")


def look_at_huge_pages() -> Iterator[Finding]:
    """Huge pages make receiving and writing cheaper: a third of the processor time to disk."""
    yield _look_at_huge_pages("triplets", _HUGE_PAGES / "enabled", "madvise", {"always", "madvise"})
    rings = {"always", "within_size", "advise", "force"}
    yield _look_at_huge_pages("the cameras' rings", _HUGE_PAGES / "shmem_enabled", "advise", rings)


def _look_at_huge_pages(user: str, path: Path, advised: str, good: set[str]) -> Finding:
    # The kernel lists all choices and puts the one in force into brackets.
    chosen = re.search(r"\[(\w+)\]", path.read_text()) if path.exists() else None
    if chosen is None:
        return warning(
            Topic.MEMORY, f"this kernel has no huge pages for {user}", "use a kernel with transparent huge pages"
        )
    what = f"huge pages for {user}: {chosen[1]}"
    if chosen[1] in good:
        return passed(Topic.MEMORY, what)
    return warning(Topic.MEMORY, what, f"run: echo {advised} | sudo tee {path}")


def _available() -> int:
    """Bytes that programs can still have."""
    match = re.search(r"^MemAvailable:\s+(\d+) kB", Path("/proc/meminfo").read_text(), re.MULTILINE)
    if match is None:
        raise OSError("/proc/meminfo does not tell what memory is available")
    return int(match[1]) * 1024
