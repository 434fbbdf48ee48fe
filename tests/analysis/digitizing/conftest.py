"""The jump that is measured by hand, rendered once for each worker."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from analysis.digitizing.desk import Desk
from analysis.digitizing.programs.orienting import Orienting
from bench.analysis.hill_logs import HillLog
from tests.analysis.digitizing.hill import adopt, opened, write_jump


@pytest.fixture(scope="session")
def rendered(tmp_path_factory: pytest.TempPathFactory) -> HillLog:
    """The jump, without anything measured."""
    return write_jump(tmp_path_factory.mktemp("digitized"))


@pytest.fixture
def jump(rendered: HillLog, tmp_path: Path) -> HillLog:
    """The jump in a folder of its own."""
    for file in (rendered.path, rendered.survey):
        (tmp_path / file.name).symlink_to(file)
    return replace(rendered, path=tmp_path / rendered.path.name, survey=tmp_path / rendered.survey.name)


@pytest.fixture(scope="session")
def orientation(rendered: HillLog) -> Iterator[Orienting]:
    """The cameras, oriented once."""
    desk = opened(rendered)
    yield desk.programs.orienting
    desk.close()


@pytest.fixture
def desk(jump: HillLog, orientation: Orienting) -> Iterator[Desk]:
    """The desk at which it is measured."""
    desk = opened(jump, survey=False)
    adopt(desk, orientation)
    yield desk
    desk.close()
