"""One log and one page for all tests of the reports: rendering takes seconds."""

from pathlib import Path

import pytest

from tests.analysis.report.jumps import EVERY, write_jump_log


@pytest.fixture(scope="session")
def jump_log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The log of the first jump of the recordings, with an image of every fourth pulse."""
    path = tmp_path_factory.mktemp("report") / "jump.mcap"
    write_jump_log(path, EVERY)
    return path
