"""What tests of the service share."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.faulty_disk import FaultyDisk


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[FaultyDisk]:
    """An empty folder whose disk fails when it is told to."""
    folder = tmp_path / "disk"
    folder.mkdir()
    disk = FaultyDisk(folder)
    yield disk
    disk.close()
