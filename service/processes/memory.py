"""The memory that the buffers of a rig take, and whether this computer has it."""

import re
import resource
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Final

from recorder.live.assembler import in_flight_triplets
from recorder.live.preroll import preroll_triplets
from recorder.log.mcap_layout import SlotLayout
from rig.errors import BadInputError
from rig.phrase import phrase
from rig.settings.model import RigSettings
from rig.transport.ring import MAX_SLOTS

_LEAST_SLOTS: Final = 16
_GB: Final = 1e9
_NO_LIMIT: Final = 1 << 60  # cgroup v1 writes a number of about this size for "no limit"


def ring_slots(rig: RigSettings) -> int:
    """Number of frames in each camera's ring."""
    wanted = round(rig.recorder.ring_s * rig.trigger.rate_hz)
    return min(MAX_SLOTS, max(_LEAST_SLOTS, wanted))


def memory_needed(rig: RigSettings, preroll_s: float) -> Mapping[str, int]:
    """Bytes of the buffers, by the key of the rig file that decides on them."""
    slot_bytes = SlotLayout(rig.triplet_shape, rig.own_topics(), rig.pixels).slot_bytes
    return {
        "recorder.ring_s": sum(camera.frame_bytes for camera in rig.cameras) * ring_slots(rig),
        "recorder.triplets_s": in_flight_triplets(rig) * slot_bytes,
        "recorder.preroll_limit_mb": preroll_triplets(rig, preroll_s, slot_bytes) * slot_bytes,
    }


def check_memory(rig: RigSettings, preroll_s: float) -> None:
    """Check that the buffers fit into the memory that is available.

    Raises:
        BadInputError: they do not; the message names the key that takes most.
    """
    needed, available = memory_needed(rig, preroll_s), available_bytes()
    if (total := sum(needed.values())) <= available:
        return
    largest = max(needed, key=lambda key: needed[key])
    text = (
        "the buffers of the rig need {total:.1f} GB of memory and {available:.1f} GB are available: lower {largest}, "
        "which takes {takes:.1f} GB, or the cameras' regions"
    )
    raise BadInputError(
        phrase(
            "why_no_memory", text,
            total=total / _GB, available=available / _GB, largest=largest, takes=needed[largest] / _GB,
        )
    )  # fmt: skip


def available_bytes(root: Path = Path("/")) -> int:
    """Memory that programs can still get: the machine's, the limit of our cgroups, what ulimit -v allows.

    Args:
        root: where `proc` and `sys` are.

    Raises:
        OSError: the machine does not tell.
    """
    match = re.search(r"^MemAvailable:\s+(\d+) kB", (root / "proc/meminfo").read_text(), re.MULTILINE)
    if match is None:
        raise OSError("/proc/meminfo does not tell what memory is available")
    allowed, _ = resource.getrlimit(resource.RLIMIT_AS)
    limits = [*_cgroup_limits(root), *([] if allowed == resource.RLIM_INFINITY else [allowed])]
    return max(0, min([int(match[1]) * 1024, *limits]))


def _cgroup_limits(root: Path) -> Iterator[int]:
    """For our cgroup and those above it that have a limit: what may still be taken, bytes."""
    for line in (root / "proc/self/cgroup").read_text().splitlines():
        number, controllers, path = line.split(":", 2)
        second = number == "0" and not controllers
        if not second and "memory" not in controllers.split(","):
            continue
        top = root / ("sys/fs/cgroup" if second else "sys/fs/cgroup/memory")
        most, used = ("memory.max", "memory.current") if second else ("memory.limit_in_bytes", "memory.usage_in_bytes")
        group = top / path.lstrip("/")
        while group.is_relative_to(top):
            if (limit := _number(group / most)) is not None and limit < _NO_LIMIT:
                yield limit - (_number(group / used) or 0) + _reclaimable(group / "memory.stat")
            group = group.parent


def _number(file: Path) -> int | None:
    """The number in a file; None if the file is not there or says "max"."""
    try:
        text = file.read_text().strip()
    except OSError:
        return None
    return int(text) if text.isdigit() else None


def _reclaimable(statistics: Path) -> int:
    """Bytes of files that the kernel keeps in memory and gives up when somebody needs it."""
    try:
        fields = dict(line.split() for line in statistics.read_text().splitlines())
    except OSError:
        return 0
    return int(fields.get("total_inactive_file", fields.get("inactive_file", "0")))
