"""A folder on another file system than the tests' folders."""

import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory


@contextmanager
def other_disk() -> Iterator[Path]:
    """A folder in shared memory, gone afterwards. It is held open, so that nobody takes it for a leak of his own."""
    with TemporaryDirectory(dir="/dev/shm", prefix="svev-test-") as folder:
        held = os.open(folder, os.O_RDONLY)
        try:
            yield Path(folder)
        finally:
            os.close(held)


def may_mount() -> bool:
    """Whether a program of ours may have mounts of its own."""
    command = ["unshare", "--mount", "true"]
    return subprocess.run(command, capture_output=True, check=False).returncode == 0
