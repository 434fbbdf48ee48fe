"""The thread in which ZeroMQ gives memory back is started once per process; here it ends with each test."""

from collections.abc import Iterator

import pytest
from zmq.utils.garbage import gc


@pytest.fixture(autouse=True)
def _zmq_gives_back() -> Iterator[None]:
    yield
    gc.stop()
