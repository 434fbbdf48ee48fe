"""A panel over a real socket, with a rig in memory."""

from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import httpx
import pytest

from tests.support.loopback import Loopback
from tests.webpanel.memory_service import MemoryService
from tests.webpanel.serving import Panel, serving
from webpanel.door.access import Access


@pytest.fixture
def service(tmp_path: Path) -> Iterator[MemoryService]:
    """The rig: idle, no recordings."""
    with closing(MemoryService(tmp_path)) as rig:
        yield rig


@pytest.fixture
def panel(service: MemoryService, loopback: Loopback) -> Iterator[Panel]:
    """The panel as on loopback: no token."""
    with serving(service, Access.for_address(loopback.host, environment={})) as running:
        yield running


@pytest.fixture
def client(panel: Panel) -> Iterator[httpx.Client]:
    """A client of it."""
    with panel.client() as opened:
        yield opened
