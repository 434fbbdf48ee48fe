"""One log and one page for all tests of the reports: rendering takes seconds."""

from pathlib import Path

import pytest

from tests.analysis.report import jumps
from tests.analysis.report.jumps import EVERY


@pytest.fixture(scope="session")
def jump_log() -> Path:
    """The log of the first jump of the recordings, with an image of every fourth pulse."""
    return jumps.jump_log(EVERY)
