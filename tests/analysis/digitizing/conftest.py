"""The jump that is measured by hand, rendered and oriented once for all workers."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from analysis.digitizing.desk import Desk
from bench.analysis.hill_logs import HillLog
from tests.analysis.digitizing.hill import Oriented, adopt, opened, orientation_of, placed, rendered_jump


@pytest.fixture
def jump(tmp_path: Path) -> HillLog:
    """The jump in a folder of its own, without anything measured."""
    return placed(rendered_jump(), tmp_path)


@pytest.fixture(scope="session")
def orientation() -> Oriented:
    """The cameras, oriented once."""
    return orientation_of(rendered_jump())


@pytest.fixture
def desk(jump: HillLog, orientation: Oriented) -> Iterator[Desk]:
    """The desk at which it is measured."""
    desk = opened(jump, survey=False)
    adopt(desk, orientation)
    yield desk
    desk.close()
