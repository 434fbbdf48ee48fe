"""How much memory this process and its children can still get."""

import re
import resource
from collections.abc import Iterator
from pathlib import Path
from typing import Final

_NO_LIMIT: Final = 1 << 60  # cgroup v1 writes a number of about this size for "no limit"


def available_bytes(root: Path = Path("/")) -> int:
    """Memory that programs can still get: what the machine has, what our cgroups allow, what ulimit -v allows.

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
